//! What one patch learns of a board, every patch that has modules of it must know.

use std::collections::BTreeSet;

use taxel_engine::snapshot::ForceSample;
use taxel_wire::icub;

use crate::prelude::*;
use crate::several_patches::{halves, plan_of};

#[test]
fn firmware_temperature_and_status_of_a_shared_board_are_known_to_both_patches() {
    let mut bench = Bench::new(small_world(), Arc::new(plan_of(halves().into())), Restored::default());
    bench.brought_up();
    let left = bench.reports_lost_acknowledgements(0x4D1);
    left.set(3);
    bench.foreign.push_back(taxel_wire::TimedFrame {
        time: bench.now(),
        frame: Frame::data(CanId::Standard(0x3DE), &[1, 0x2C, 1, 0, 0]).unwrap(),
    });
    bench.seconds(1.5);
    let boards = &bench.host.health().boards;
    let shared: Vec<_> = boards.iter().filter(|board| board.address == 13).collect();
    assert_eq!(shared.len(), 2, "one entry a patch: {boards:?}");
    for board in shared {
        assert_eq!((board.status_errors, board.celsius), (3, Some(30.0)), "{board:?}");
        assert!(board.firmware.is_some(), "{board:?}");
    }
}

/// The lower half is calibrated and in use, the upper has no models.
fn lower_in_use() -> Bench {
    let mut bench = Bench::new(small_world(), Arc::new(plan_of(halves().into())), Restored::default());
    bench.brought_up();
    bench.seconds(1.5);
    calibrate(&mut bench, "lower");
    bench
}

fn calibrate(bench: &mut Bench, name: &str) {
    bench.ask(say::start_on(name, Some(20.0), &[])).unwrap();
    bench.until_state(10.0, SessionState::Ramping);
    bench.ramp(25.0, 4.0);
    let made = |host: &Host| host.sessions.iter().rev().find(|view| view.patch == name)?.model_set.clone();
    bench.until(20.0, "a model set", |host| made(host).is_some());
    let model_set = made(&bench.host).unwrap();
    bench.ask(Command::Activate { patch: name.to_owned(), model_set: model_set.to_string(), expected: None }).unwrap();
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
}

/// Both halves are calibrated, and the daemon starts once more.
fn restarted_with_both_in_use() -> Bench {
    let mut before = lower_in_use();
    calibrate(&mut before, "upper");
    before.again(Arc::new(plan_of(halves().into())))
}

fn both_have_a_force(host: &Host) -> bool {
    let lower = host.others.get(&1).is_some_and(|snapshot| snapshot.force.total.is_some());
    lower && host.snapshots.last().is_some_and(|snapshot| snapshot.force.total.is_some())
}

fn confirmed(name: &str) -> Command {
    Command::BringUp { patch: name.to_owned(), confirmed_by: Some("Ada".to_owned()) }
}

/// Board 13 is of both, board 12 of the lower half alone.
#[test]
fn a_bring_up_configures_a_shared_board_for_all_its_patches_unless_one_of_them_feels_a_force() {
    let mut bench = restarted_with_both_in_use();
    bench.until(8.0, "a force of both", both_have_a_force);
    bench.lay(1.0, 65); // on the lower half
    bench.seconds(2.0);
    let why = bench.refused(confirmed("upper"));
    assert!(why.contains("lower"), "{why}");
    bench.seconds(1.0);
    assert_eq!(bench.host.sent, [], "boards that stream are left alone, and so are those that bear a load");
    bench.world.clear();
    bench.seconds(2.0);
    for (name, boards) in [("upper", vec![13]), ("lower", vec![12, 13])] {
        let first = bench.host.sent.len();
        bench.ask(confirmed(name)).unwrap();
        bench.seconds(0.1);
        assert!(!both_have_a_force(&bench.host), "{name} was brought up: both have lost their zero");
        bench.brought_up();
        let to: BTreeSet<u8> =
            bench.host.sent[first..].iter().map(|(_, frame)| icub::Command::decode(frame).unwrap().0.get()).collect();
        assert!(to.into_iter().eq(boards), "{name}");
        assert!(bench.host.health().boards.iter().all(|board| board.modules.0 == board.modules.1));
    }
}

#[test]
fn acknowledgements_that_modules_of_one_patch_lose_invalidate_the_zero_of_the_other() {
    let mut bench = lower_in_use();
    bench.ask(Command::Tare { patch: "lower".to_owned(), confirmed_by: None }).unwrap();
    let lower = |host: &Host| -> ForceSample { host.others[&1].force.clone() };
    bench.until(3.0, "a force", |host| lower(host).total.is_some());
    assert_eq!(lower(&bench.host).state, ForceState::Ok);
    let left = bench.reports_lost_acknowledgements(0x4D1); // of the upper half
    left.set(5);
    bench.until(1.0, "five", |host| {
        lower(host).reasons.iter().any(|why| why.text().contains("5 lost acknowledgements"))
    });
    assert_eq!(lower(&bench.host).state, ForceState::TareInvalid);
}
