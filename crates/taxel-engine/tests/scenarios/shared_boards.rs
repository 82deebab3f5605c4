//! What one patch learns of a board, every patch that has modules of it must know.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::command::Command;
use taxel_engine::record::BoardZeros;
use taxel_engine::snapshot::{ForceSample, ForceState};
use taxel_sim::PumpCommand;
use taxel_wire::{CanId, Frame};

use crate::bench::Bench;
use crate::host::Host;
use crate::rig::small_world;
use crate::several_patches::{halves, plan_of};

/// Lets the tails of a module report so many lost acknowledgements, though nothing is wrong with its counts.
fn report_lost_acknowledgements(bench: &mut Bench, id: u16) -> Rc<Cell<u32>> {
    let left = Rc::new(Cell::new(0));
    let reports = Rc::clone(&left);
    bench.alters = Box::new(move |timed| {
        if let [0xC0, .., _] = timed.frame.bytes()
            && timed.frame.id == CanId::Standard(id)
            && reports.get() > 0
        {
            reports.set(reports.get() - 1);
            let mut tail = timed.frame.bytes().to_vec();
            tail[7] |= 1;
            timed.frame = Frame::data(timed.frame.id, &tail).unwrap();
        }
    });
    left
}

#[test]
fn firmware_temperature_and_status_of_a_shared_board_are_known_to_both_patches() {
    let mut bench = Bench::new(small_world(), Arc::new(plan_of(halves().into())), Restored::default());
    bench.brought_up();
    let left = report_lost_acknowledgements(&mut bench, 0x4D1);
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
    let (patch, target) = (name.to_owned(), Some(taxel_skin::Kilopascal(20.0)));
    let start = Command::StartSession { patch, target, branches: None, confirmed_by: None, leave_out: Vec::new() };
    bench.ask(start).unwrap();
    bench.until_state(10.0, taxel_engine::calibration::SessionState::Ramping);
    bench.ramp(25.0, 4.0);
    bench.until(20.0, "a model set", |host| host.session().model_set.is_some());
    let model_set = bench.host.session().model_set.clone().unwrap();
    bench.ask(Command::Activate { patch: name.to_owned(), model_set: model_set.to_string(), expected: None }).unwrap();
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
}

/// The upper half has no models that would show a load, and so nothing to wait for. But its commands would make the board
/// forget the modules of the lower half, and take the load on these for nothing.
#[test]
fn a_shared_board_is_configured_once_nothing_presses_on_either_patch() {
    let before = lower_in_use();
    let model_sets = before.host.catalogue.model_sets.clone();
    let active = vec![("lower".to_owned(), model_sets[0].id.to_string())];
    let restored = Restored { model_sets, active, next_session: 2, ..Restored::default() };
    let mut bench = Bench::new(before.world, Arc::new(plan_of(halves().into())), restored);
    bench.lay(0.5, 45);
    bench.seconds(3.0);
    assert_eq!(bench.host.sent, [], "nothing is sent to boards that bear a load");
    bench.world.clear();
    bench.brought_up();
    bench.seconds(1.5);
    for board in &bench.host.health().boards {
        assert_eq!(board.modules.0, board.modules.1, "{board:?}");
    }
}

/// Both halves are calibrated, and the daemon starts once more.
fn restarted_with_both_in_use() -> Bench {
    restarted_with_doubts(Vec::new())
}

/// With what was held against the zeros of each patch's boards.
fn restarted_with_doubts(doubts: Vec<(String, String)>) -> Bench {
    let mut before = lower_in_use();
    calibrate(&mut before, "upper");
    let model_sets = before.host.catalogue.model_sets.clone();
    let active = before.host.catalogue.active.iter().filter_map(|(patch, set)| Some((patch.clone(), set.clone()?)));
    let known = |(patch, why)| (patch, BoardZeros { unproven: Some(why), ..BoardZeros::default() });
    let board_zeros = doubts.into_iter().map(known).collect();
    let active = active.collect();
    let restored = Restored { active, model_sets, next_session: 3, board_zeros, ..Restored::default() };
    assert_eq!(restored.active.len(), 2);
    Bench::new(before.world, Arc::new(plan_of(halves().into())), restored)
}

/// One patch is ready and waits for the other: what comes to lie on it meanwhile must not be taken for nothing.
#[test]
fn a_load_that_comes_while_the_boards_wait_for_another_patch_keeps_them_waiting() {
    let mut bench = restarted_with_both_in_use();
    bench.lay(0.5, 45); // on the lower half
    bench.seconds(6.0);
    bench.world.clear();
    bench.lay(0.5, 14); // on the upper half, which was at rest until now
    bench.seconds(6.0);
    assert_eq!(bench.host.sent, [], "nothing is sent to boards that bear a load");
    assert!(bench.host.reasons().contains("finds nothing on it: loaded: "), "{}", bench.host.reasons());
    bench.world.clear();
    bench.brought_up();
    bench.until_force(5.0, ForceState::Ok);
}

/// Its models show what lies on it from then on, so that it is looked at like the other.
#[test]
fn a_set_that_is_activated_while_its_boards_wait_for_another_patch_keeps_nobody_waiting() {
    let mut before = lower_in_use();
    calibrate(&mut before, "upper");
    let model_sets = before.host.catalogue.model_sets.clone();
    let upper = model_sets.iter().find(|set| set.patch == "upper").unwrap().id.clone();
    let lower = model_sets.iter().find(|set| set.patch == "lower").unwrap().id.clone();
    let active = vec![("lower".to_owned(), lower)];
    let restored = Restored { model_sets, active, next_session: 3, ..Restored::default() };
    let mut bench = Bench::new(before.world, Arc::new(plan_of(halves().into())), restored);
    bench.lay(0.5, 45); // on the lower half
    bench.seconds(3.0);
    bench.ask(Command::Activate { patch: "upper".to_owned(), model_set: upper, expected: None }).unwrap();
    bench.seconds(2.0);
    assert_eq!(bench.host.sent, [], "nothing is sent to boards that bear a load");
    bench.world.clear();
    bench.brought_up();
    bench.until_force(5.0, ForceState::Ok);
}

/// The one that waits is looked at again and again, and what came within the look that still runs is in none that has ended.
#[test]
fn a_load_that_comes_just_before_the_boards_of_both_are_ready_keeps_them_waiting() {
    for tenths in 8..24 {
        let mut bench = restarted_with_both_in_use();
        bench.lay(0.5, 14); // on the upper half
        bench.seconds(4.3);
        bench.world.clear();
        bench.seconds(0.1 * f64::from(tenths));
        let sent = bench.host.sent.len();
        bench.lay(0.5, 45); // on the lower half, which was at rest until now
        bench.seconds(4.0);
        assert!(
            sent > 0 || bench.host.sent.is_empty(),
            "configured under a load that came {tenths} tenths after the other"
        );
    }
}

/// As the refusal of the loaded one says. The other, which was ready and waited, must not be left behind.
#[test]
fn a_bring_up_that_somebody_vouches_for_configures_all_patches_of_a_board_that_waited() {
    for name in ["upper", "lower"] {
        for loaded in [45, 14] {
            let mut bench = restarted_with_both_in_use();
            bench.lay(0.5, loaded);
            bench.seconds(4.0);
            assert_eq!(bench.host.sent, [], "{name}: nothing is sent to boards that bear a load");
            bench.ask(Command::BringUp { patch: name.to_owned(), confirmed_by: Some("Ada".to_owned()) }).unwrap();
            bench.world.clear();
            bench.brought_up();
            bench.until(8.0, "both have a force", |host| {
                let lower = host.others.get(&1).is_some_and(|snapshot| snapshot.force.total.is_some());
                lower && host.snapshots.last().is_some_and(|snapshot| snapshot.force.total.is_some())
            });
        }
    }
}

#[test]
fn who_vouches_for_one_patch_vouches_for_no_other_that_feels_a_force() {
    let mut bench = restarted_with_both_in_use();
    bench.brought_up();
    bench.until(8.0, "a force of the other", |host| {
        host.others.get(&1).is_some_and(|snapshot| snapshot.force.total.is_some())
    });
    bench.lay(1.0, 65); // on the lower half
    bench.seconds(2.0);
    let sent = bench.host.sent.len();
    let vouched = |name: &str| Command::BringUp { patch: name.to_owned(), confirmed_by: Some("Ada".to_owned()) };
    let why = bench.refused(vouched("upper"));
    assert!(why.contains("lower"), "{why}");
    bench.seconds(1.0);
    assert_eq!(bench.host.sent.len(), sent, "nothing is sent to boards that bear a load");
    bench.ask(vouched("lower")).unwrap();
}

#[test]
fn who_vouches_for_one_patch_takes_nothing_back_that_is_held_against_another() {
    let vouched = |name: &str| Command::BringUp { patch: name.to_owned(), confirmed_by: Some("Ada".to_owned()) };
    let mut bench = restarted_with_doubts(vec![("lower".to_owned(), "its load vanished".to_owned())]);
    bench.ask(vouched("upper")).unwrap();
    bench.seconds(4.0);
    assert_eq!(bench.host.sent, [], "what lies on the lower half is not known");
    bench.ask(vouched("lower")).unwrap();
    bench.brought_up();
}

/// The word for one patch lasts until the other's has come: each alone configures nothing.
#[test]
fn two_patches_that_are_both_held_against_are_configured_once_somebody_vouches_for_either() {
    let vouched = |name: &str| Command::BringUp { patch: name.to_owned(), confirmed_by: Some("Ada".to_owned()) };
    let doubt = |name: &str| (name.to_owned(), "its load vanished".to_owned());
    let mut bench = restarted_with_doubts(vec![doubt("upper"), doubt("lower")]);
    bench.seconds(2.0);
    bench.ask(vouched("upper")).unwrap();
    bench.seconds(2.0);
    assert_eq!(bench.host.sent, [], "what lies on the lower half is not known");
    bench.ask(vouched("lower")).unwrap();
    bench.brought_up();
    bench.until_force(8.0, ForceState::Ok);
}

#[test]
fn acknowledgements_that_modules_of_one_patch_lose_invalidate_the_zero_of_the_other() {
    let mut bench = lower_in_use();
    bench.ask(Command::Tare { patch: "lower".to_owned(), confirmed_by: None }).unwrap();
    let lower = |host: &Host| -> ForceSample { host.others[&1].force.clone() };
    bench.until(3.0, "a force", |host| lower(host).total.is_some());
    assert_eq!(lower(&bench.host).state, ForceState::Ok);
    let left = report_lost_acknowledgements(&mut bench, 0x4D1); // of the upper half
    left.set(5);
    bench.until(1.0, "five", |host| {
        lower(host).reasons.iter().any(|why| why.text().contains("5 lost acknowledgements"))
    });
    assert_eq!(lower(&bench.host).state, ForceState::TareInvalid);
}
