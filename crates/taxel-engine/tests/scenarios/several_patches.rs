//! Patches that share a bus, a board or a gauge.

use std::ops::Range;

use taxel_engine::conflict::{Conflict, conflicts};
use taxel_engine::plan::Gauge;
use taxel_sim::GaugeConfig;

use crate::prelude::*;
use crate::rig::{setup, triangles};

/// A patch of these modules, by board.
fn patch(name: &str, boards: &[(u8, Range<u8>)]) -> PatchPlan {
    let patch = triangles(name, boards);
    PatchPlan {
        bring_up: patch.boards().iter().map(setup).collect(),
        gauge: Some(Gauge::new(BUS, GaugeConfig::default().signal)),
        ..PatchPlan::new(patch)
    }
}

pub fn plan_of(patches: Vec<PatchPlan>) -> Plan {
    Plan { buses: 1, patches }
}

/// Board 13 in halves, the second with board 12.
pub fn halves() -> [PatchPlan; 2] {
    [patch("upper", &[(13, 0..3)]), patch("lower", &[(13, 3..6), (12, 0..2)])]
}

#[test]
fn patches_that_share_a_board_are_fine_and_a_module_is_not() {
    assert_eq!(conflicts(&plan_of(halves().into())), []);
    let overlapping = plan_of(vec![patch("upper", &[(13, 0..4)]), patch("lower", &[(13, 3..6)])]);
    let why = "module 3 of board 13 is in patch `upper` and in patch `lower`: expected in one only".to_owned();
    assert_eq!(conflicts(&overlapping), [Conflict { patch: "lower".to_owned(), why }]);
    let twice = plan_of(vec![patch("upper", &[(13, 0..2)]), patch("lower", &[(13, 0..2)])]);
    assert_eq!(conflicts(&twice).len(), 2, "both modules: {:?}", conflicts(&twice));
}

#[test]
fn patches_that_configure_a_board_each_in_its_way_are_a_conflict() {
    let why = "board 13 is configured by patch `upper` and by patch `lower` with other settings: expected the same period, type, \
               no-load value and listen_only in both";
    let shared = [Conflict { patch: "lower".to_owned(), why: why.to_owned() }];
    let change = |change: &dyn Fn(&mut PatchPlan)| {
        let [upper, mut lower] = halves();
        change(&mut lower);
        conflicts(&plan_of(vec![upper, lower]))
    };
    assert_eq!(change(&|lower| lower.period *= 2), shared);
    assert_eq!(change(&|lower| lower.bring_up[0].board.period_ms = 100), shared);
    assert_eq!(change(&|lower| lower.bring_up.clear()), shared, "one only listens");
    assert_eq!(change(&|lower| lower.bring_up[1].board.period_ms = 100), [], "board 12 is the second's alone");
}

#[test]
fn a_gauge_with_an_identifier_of_a_board_is_a_conflict() {
    for (id, is_used) in [(0x4D3, true), (0x3C1, true), (0x6D0, true), (0x2C0, true), (0x4D6, false), (0x4E0, false)] {
        let [mut upper, lower] = halves();
        upper.gauge.as_mut().unwrap().signal.id = CanId::Standard(id);
        let found = conflicts(&plan_of(vec![upper, lower]));
        let why = format!("identifier {} of the gauge of patch `upper` is that of board", CanId::Standard(id));
        let named = found.iter().any(|conflict| conflict.patch == "upper" && conflict.why.starts_with(&why));
        assert_eq!(named, is_used, "{id:#x}: {found:?}");
    }
}

fn both() -> Bench {
    let mut bench = Bench::new(small_world(), Arc::new(plan_of(halves().into())), Restored::default());
    bench.brought_up();
    bench.seconds(1.5);
    bench
}

fn start_lower(bench: &mut Bench) {
    bench.ask(say::start_on("lower", None, &[])).unwrap();
}

#[test]
fn a_bring_up_is_refused_while_a_session_holds_a_patch_that_shares_a_board() {
    let mut bench = both();
    start_lower(&mut bench);
    let why = bench.refused(Command::BringUp { patch: "upper".to_owned(), confirmed_by: None });
    assert!(why.contains("session 1 is TARING"), "{why}");
}

/// The first patch expects a longer frame than the gauge sends, the second takes it as it is.
#[test]
fn a_gauge_frame_that_one_patch_refuses_still_reaches_the_next() {
    let [mut upper, lower] = halves();
    upper.gauge.as_mut().unwrap().signal.start_bit = 48;
    let mut bench = Bench::new(small_world(), Arc::new(plan_of(vec![upper, lower])), Restored::default());
    bench.brought_up();
    start_lower(&mut bench);
    bench.until_state(10.0, SessionState::Ramping);
    bench.ramp(20.0, 4.0);
    bench.seconds(4.0);
    assert!(bench.host.session().pressure_kpa.is_some_and(|kpa| kpa > 10.0), "{:?}", bench.host.session());
    assert!(bench.host.session().accepted > 20, "{:?}", bench.host.session());
    let bus = &bench.host.health().buses[0];
    assert!(bus.malformed > 0 && !bus.last_malformed.is_empty(), "the refusal is counted: {bus:?}");
}

#[test]
fn a_patch_is_named_where_there_are_several_and_sessions_have_numbers_of_their_own() {
    let mut bench = both();
    let tare = |patch: &str| Command::Tare { patch: patch.to_owned(), confirmed_by: None };
    let refused = bench.ask(tare("")).unwrap_err().to_string();
    assert_eq!(refused, "patch: must name one of the patches: upper, lower");
    let unknown = bench.ask(tare("elbow")).unwrap_err().to_string();
    assert!(unknown.contains("`elbow`; this daemon has upper, lower"), "{unknown}");
    for (number, name) in [(1, "lower"), (2, "upper")] {
        let view = session_of(bench.ask(say::start_on(name, None, &[])));
        assert_eq!((view.number, view.patch.as_str()), (number, name));
    }
    let view = session_of(bench.ask(Command::AbortSession { session: 1, reason: None }));
    assert_eq!((view.patch.as_str(), view.reason.as_str()), ("lower", "an operator aborted it"));
    let view = session_of(bench.ask(Command::DiscardSession { session: 1 }));
    assert_eq!(view.reason, "an operator laid it aside");
}

/// Four parts of a robot are calibrated at a time: what one writes down is none of the others' business.
#[test]
fn a_change_that_waits_for_the_disk_keeps_no_other_patch_waiting() {
    let mut bench = both();
    for (patch, taxels) in [("upper", 30), ("lower", 50)] {
        let none = taxel_model::TaxelModel::without_curve(taxel_model::Status::NoData, Default::default());
        let (id, taxels) = (format!("m-{patch}"), vec![none; taxels]);
        let set = ModelSet { id, patch: patch.to_owned(), taxels, ..ModelSet::default() };
        bench.ask(Command::Import { model_set: Arc::new(set), insist: true }).expect("it is kept");
    }
    bench.host.disk_is_slow = true;
    let delete = |patch: &str| Command::DeleteModelSet { model_set: format!("m-{patch}") };
    let [upper, lower] = ["upper", "lower"].map(|patch| bench.host.command(delete(patch)));
    assert_eq!(bench.refused(delete("upper")), "model set `m-upper` is being deleted: ask again");
    bench.host.commit(Ok(()));
    for request in [upper, lower] {
        assert!(matches!(bench.host.reply(request), Some(Ok(Done::Deleted))), "each is deleted");
    }
}
