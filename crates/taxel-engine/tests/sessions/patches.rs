//! Commands where there are several patches: which one is meant, and whose boards are shared.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use taxel_engine::command::{Command, Done, Rejection, Reply, RequestId};
use taxel_engine::plan::{BoardSetup, PatchPlan, Plan};
use taxel_engine::{Engine, ErrorReason, Input, Now, Output, Restored};
use taxel_model::GaugeUncertainty;
use taxel_sim::GaugeConfig;
use taxel_skin::{Board, BoardAddress, Kilopascal, Module, ModuleKind, Patch, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::Command as BoardCommand;

use crate::world::{BUS, EPOCH_NS, plan};

/// One module of each board.
fn patch(name: &str, boards: &[(u8, u8)]) -> PatchPlan {
    let board = |&(address, module): &(u8, u8)| Board {
        bus: BUS,
        address: BoardAddress::new(address).unwrap(),
        modules: vec![(Module::new(module).unwrap(), ModuleKind::Triangle)],
    };
    let like = &plan().patches[0];
    let setup = BoardSetup { ..like.bring_up[0].clone() };
    let bring_up = vec![setup; boards.len()];
    let patch = Patch::new(name, boards.iter().map(board).collect()).unwrap();
    PatchPlan { bring_up, gauge: like.gauge.clone(), session: like.session, ..PatchPlan::new(patch) }
}

/// `upper` and `middle` share board 13, `middle` and `lower` board 12; `far` shares none.
fn engine() -> Engine {
    let patches = vec![
        patch("upper", &[(13, 0)]),
        patch("far", &[(9, 0)]),
        patch("middle", &[(12, 0), (13, 1)]),
        patch("lower", &[(11, 0), (12, 1)]),
    ];
    Engine::new(Arc::new(Plan { buses: 1, patches }), Restored::default())
}

fn step(engine: &mut Engine, time: Time, input: Input<'_>) -> Vec<Output> {
    let mut out = Vec::new();
    engine.step(Now { time, wall_ns: EPOCH_NS + time.as_nanos() }, input, &mut out);
    out
}

fn ask(engine: &mut Engine, time: Time, command: Command) -> Reply {
    let out = step(engine, time, Input::Command(RequestId(1), command));
    let reply = out.into_iter().find_map(|out| if let Output::Reply(_, reply) = out { Some(reply) } else { None });
    reply.expect("it is answered at once")
}

/// Lets time pass, and counts the starts that go to each board.
fn starts(engine: &mut Engine, from: Time, until: Time) -> BTreeMap<u8, usize> {
    let mut starts = BTreeMap::new();
    let mut now = from;
    while now < until {
        for out in step(engine, now, Input::Tick) {
            let Output::Send(_, frame) = out else { continue };
            if let Some((board, BoardCommand::Start)) = BoardCommand::decode(&frame) {
                *starts.entry(board.get()).or_default() += 1;
            }
        }
        now = now + Duration::from_millis(100);
    }
    starts
}

#[test]
fn boards_are_configured_for_all_patches_that_have_them_and_no_others_are() {
    let seconds = |s: i64| Time::from_nanos(s * 1_000_000_000);
    for (name, boards) in [("upper", [13].as_slice()), ("lower", &[11, 12]), ("far", &[9])] {
        let mut engine = engine();
        let all = starts(&mut engine, seconds(0), seconds(5));
        assert_eq!(all, BTreeMap::from([(9, 1), (11, 1), (12, 2), (13, 2)]));
        let reply = ask(&mut engine, seconds(5), Command::BringUp { patch: name.to_owned(), confirmed_by: None });
        assert!(matches!(reply, Ok(Done::BringUpStarted)), "{reply:?}");
        let expected = all.into_iter().filter(|(board, _)| boards.contains(board)).collect();
        assert_eq!(starts(&mut engine, seconds(5), seconds(10)), expected, "{name}");
    }
}

#[test]
fn a_patch_is_named_where_there_are_several() {
    let mut engine = engine();
    let tare = |patch: &str| Command::Tare { patch: patch.to_owned(), confirmed_by: None };
    let Err(Rejection::InvalidArgument { field, problem }) = ask(&mut engine, Time::default(), tare("")) else {
        panic!("it was not refused")
    };
    assert_eq!((field, problem.as_str()), ("patch", "must name one of the patches: upper, far, middle, lower"));
    let unknown = ask(&mut engine, Time::default(), tare("elbow")).unwrap_err();
    assert!(unknown.to_string().contains("`elbow`; this daemon has upper, far"), "{unknown}");
    // One session at a time of each patch, with numbers of their own.
    for (number, name) in [(1, "lower"), (2, "upper")] {
        let patch = name.to_owned();
        let (target, branches, confirmed_by, leave_out) = (None, None, None, Vec::new());
        let start = Command::StartSession { patch, target, branches, confirmed_by, leave_out };
        let Ok(Done::Session(view)) = ask(&mut engine, Time::default(), start) else { panic!("no session") };
        assert_eq!((view.number, view.patch.as_str()), (number, name));
    }
    let ended = ask(&mut engine, Time::default(), Command::AbortSession { session: 1 });
    let Ok(Done::Session(view)) = ended else { panic!("{ended:?}") };
    assert_eq!((view.patch.as_str(), view.reason.as_str()), ("lower", "an operator aborted it"));
    // What gathers nothing any more ends once that is on disk.
    let discard = Input::Command(RequestId(1), Command::DiscardSession { session: 1 });
    let out = step(&mut engine, Time::default(), discard);
    let [Output::Commit { ticket, .. }] = out.as_slice() else { panic!("{out:?}") };
    let written = Input::Committed { ticket: *ticket, result: Ok(()) };
    let out = step(&mut engine, Time::default(), written);
    let reply = out.iter().find_map(|out| if let Output::Reply(_, reply) = out { Some(reply) } else { None });
    let Some(Ok(Done::Session(view))) = reply else { panic!("{out:?}") };
    assert_eq!(view.reason, "an operator laid it aside");
}

/// A vented bag is at 10 kPa at most, and at no less than 0.3 kPa and three standard deviations of the gauge below none.
#[test]
fn what_a_bag_may_be_at_when_boards_are_configured() {
    for (kpa, later_ms, refused) in [
        (-1.79, 100, None),
        (-1.81, 100, Some((ErrorReason::GaugeOffset, "no less than -1.80 kPa: set the gauge's zero"))),
        (10.0, 100, None),
        (10.01, 100, Some((ErrorReason::BagPresses, "vent it below 10.0 kPa first"))),
        (10.01, 500, Some((ErrorReason::BagPresses, "presses on the skin"))),
        // A reading that is older says nothing any more.
        (10.01, 501, None),
        (-1.81, 501, None),
    ] {
        let mut patch = patch("only", &[(13, 0)]);
        patch.fit.gauge = GaugeUncertainty { gain_rel: 0.5, offset_kpa: 0.3, noise_kpa: 0.4 };
        let mut engine = Engine::new(Arc::new(Plan { buses: 1, patches: vec![patch] }), Restored::default());
        let time = Time::from_nanos(1_000_000_000);
        let frame = GaugeConfig::default().signal.encode(Kilopascal(kpa)).unwrap();
        step(&mut engine, time, Input::Frames(BUS, &[TimedFrame { time, frame }]));
        let bring_up = Command::BringUp { patch: String::new(), confirmed_by: Some("Ada".to_owned()) };
        match (ask(&mut engine, time + Duration::from_millis(later_ms), bring_up), refused) {
            (Ok(Done::BringUpStarted), None) => {}
            (Err(Rejection::FailedPrecondition(is, why)), Some((reason, words))) => {
                assert!(is == reason && why.contains(words), "{kpa} kPa: {why}");
            }
            (reply, _) => panic!("{kpa} kPa, {later_ms} ms later: {reply:?}"),
        }
    }
}
