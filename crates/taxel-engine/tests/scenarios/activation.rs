//! Activation beside sessions, foreign sets, fits that fail, and what a session can do after it ended.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::{SampleRefusal, SessionState, SessionView};
use taxel_engine::command::{Command, Done};
use taxel_engine::model_set::ModelSet;
use taxel_engine::snapshot::ForceState;
use taxel_sim::{Fault, PumpCommand};
use taxel_wire::CanId;

use crate::bench::{Bench, Disk, session_of};
use crate::rig::{board, module, patch_plan, plan, small_world};
use crate::shared::small;

/// A session in review after a ramp to about 30 kPa, the bag vented; its number and its set.
fn in_review() -> (Bench, u64, String) {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let session = bench.start_session(None);
    bench.ramp(32.0, 4.0);
    bench.seconds(8.0);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    let set = bench.host.session().model_set.as_deref().unwrap().to_owned();
    (bench, session, set)
}

fn ramps_again(bench: &mut Bench, session: u64) {
    session_of(bench.ask(Command::StartRamp { session }));
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(40.0, 4.0);
}

fn view(bench: &Bench, number: u64) -> SessionView {
    SessionView::clone(bench.host.catalogue.sessions.iter().find(|s| s.number == number).unwrap())
}

/// A set of another robot that carries the number of a session here.
fn foreign(number: u64) -> Arc<ModelSet> {
    Arc::new(ModelSet { id: "m-foreign".to_owned(), session: Some(number), ..ModelSet::clone(&small().set) })
}

#[test]
fn a_set_that_is_activated_while_its_session_ramps_leaves_the_ramp_alone() {
    let (mut bench, session, set) = in_review();
    ramps_again(&mut bench, session);
    bench.seconds(3.0);
    bench.activate(&set).unwrap();
    assert_eq!(view(&bench, session).state, SessionState::Ramping);
    let before = bench.host.session().accepted;
    bench.seconds(5.0);
    assert!(bench.host.session().accepted > before + 50, "samples go on to enter: {:?}", bench.host.session());
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some(set.as_str()));
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    assert_eq!((bench.host.catalogue.model_sets.len(), view(&bench, session).ramps), (2, 2));
}

#[test]
fn a_set_that_is_activated_while_its_session_is_fitted_does_not_cost_the_new_one() {
    let (mut bench, session, set) = in_review();
    ramps_again(&mut bench, session);
    bench.seconds(8.0);
    bench.host.command(Command::FinishRamp { session });
    let activation =
        bench.host.command(Command::Activate { patch: String::new(), model_set: set.clone(), expected: None });
    assert_eq!(view(&bench, session).state, SessionState::Fitting);
    assert!(matches!(bench.host.reply(activation), Some(Ok(Done::Activated { .. }))));
    bench.until_state(1.0, SessionState::Review);
    let newest = bench.host.catalogue.model_sets.last().unwrap().id.clone();
    assert!(newest != set && view(&bench, session).model_set.as_deref() == Some(newest.as_str()));
}

#[test]
fn a_foreign_set_leaves_this_robots_session_of_its_number_alone() {
    let (mut bench, session, _) = in_review();
    bench.ask(Command::Import { model_set: foreign(session), insist: false }).unwrap();
    let before = view(&bench, session);
    bench.activate("m-foreign").unwrap();
    assert_eq!(view(&bench, session), before, "it is not this session's set that is in use");
    // Nor does it keep the session from another ramp, or from being laid aside.
    ramps_again(&mut bench, session);
    bench.activate("m-foreign").unwrap();
    assert_eq!(view(&bench, session).state, SessionState::Ramping);
    bench.seconds(8.0);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    session_of(bench.ask(Command::DiscardSession { session }));
    bench.activate("m-foreign").unwrap();
    assert_eq!(view(&bench, session).state, SessionState::Discarded);
}

#[test]
fn a_fit_that_panics_ends_its_session_and_keeps_the_samples() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let session = bench.start_session(None);
    bench.ramp(32.0, 4.0);
    bench.seconds(8.0);
    bench.host.fits_panic = true;
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Failed);
    let failed = bench.host.session().clone();
    assert!(failed.reason.contains("internal error"), "{}", failed.reason);
    bench.host.fits_panic = false;
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    assert_eq!(bench.host.session().accepted, failed.accepted);
    assert!(bench.host.session().model_set.is_some());
}

/// A session that never finds rest, with a patience of ten seconds; how long it waits when the wall clock is set.
fn waits_when_the_wall_clock_is_set_by(hours: i64) -> Duration {
    let mut patch = patch_plan(&small().skin);
    patch.session.patience = Duration::from_secs(10);
    let mut bench = Bench::new(small_world(), plan(patch), Restored::default());
    bench.brought_up();
    bench.inject(Fault::ModuleSilent(board(13), module(3)));
    bench.seconds(0.5);
    let begun = bench.now();
    bench
        .ask(Command::StartSession {
            patch: String::new(),
            target: None,
            branches: None,
            confirmed_by: None,
            leave_out: Vec::new(),
        })
        .unwrap();
    bench.seconds(2.0);
    bench.host.wall_offset_ns = hours * 3_600_000_000_000;
    bench.until_state(30.0, SessionState::Failed);
    let why = &bench.host.session().reason;
    assert!(why.contains("board 13 module 3"), "the silent module is named: {why}");
    bench.now().since(begun)
}

#[test]
fn the_patience_of_a_session_does_not_hang_on_the_wall_clock() {
    let [earlier, same, later] = [-48, 0, 48].map(waits_when_the_wall_clock_is_set_by);
    assert!(same >= Duration::from_secs(10) && same <= Duration::from_secs(14), "{same:?}");
    assert_eq!((earlier, later), (same, same));
}

#[test]
fn failed_and_aborted_sessions_take_a_ramp_also_after_a_restart() {
    for aborts in [true, false] {
        let mut patch = patch_plan(&small().skin);
        patch.session.patience = Duration::from_secs(3);
        let mut bench = Bench::new(small_world(), plan(patch.clone()), Restored::default());
        bench.brought_up();
        let session = bench.start_session(None);
        bench.ramp(32.0, 4.0);
        bench.seconds(6.0);
        if aborts {
            bench.ask(Command::AbortSession { session }).unwrap();
            bench.until_state(1.0, SessionState::Aborted);
        } else {
            bench.inject(Fault::GaugeSilent);
            bench.until_state(8.0, SessionState::Failed);
            bench.repair(Fault::GaugeSilent);
        }
        let accepted = bench.host.session().accepted;
        assert!(accepted > 50, "{accepted}");
        let mut world = bench.world.clone();
        world.pump(PumpCommand::Vent);
        world.advance(bench.now() + Duration::from_secs(20), &mut Vec::new());
        let mut resumed = Bench::after(world, plan(patch), Disk::after_a_crash(&bench.host));
        resumed.brought_up();
        ramps_again(&mut resumed, session);
        resumed.seconds(8.0);
        resumed.ask(Command::FinishRamp { session }).unwrap();
        resumed.until_state(1.0, SessionState::Review);
        let view = resumed.host.session();
        assert!(view.ramps == 2 && view.accepted > accepted + 50, "aborted {aborts}: {view:?}");
    }
}

#[test]
fn a_module_that_is_silent_all_the_time_can_be_left_out() {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    bench.inject(Fault::ModuleSilent(board(13), module(3)));
    bench.seconds(0.5);
    let start = |leave_out: Vec<(u8, u8)>| Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out,
    };
    let session = session_of(bench.ask(start(vec![(13, 3)]))).number;
    bench.until_state(10.0, SessionState::Ramping);
    assert_eq!(bench.host.session().left_out, [3]);
    bench.ramp(42.0, 4.0);
    bench.seconds(2.0);
    let stale = |bench: &Bench| bench.host.session().refused.get(SampleRefusal::StaleModule);
    assert_eq!(stale(&bench), 0, "what is left out is missed by no sample");
    let silent = bench.now()..bench.now() + Duration::from_millis(100);
    bench.passes = Box::new(move |frame| frame.frame.id != CanId::Standard(0x4D2) || !silent.contains(&frame.time));
    bench.seconds(0.3);
    assert_eq!(stale(&bench), 2, "two missed scans");
    bench.seconds(8.7);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    let set = bench.host.set(0);
    assert!(set.taxels[30..40].iter().all(|model| !model.is_usable()), "nothing is made of what was not heard");
    assert!(set.taxels.iter().filter(|model| model.is_usable()).count() >= 60);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(20.0);
    bench.activate(&set.id).unwrap();
    bench.tare(None).unwrap();
    let mark = bench.mark();
    bench.lay(0.5, 14);
    bench.seconds(2.0);
    assert_eq!(bench.host.state(), ForceState::Degraded, "{}", bench.host.reasons());
    assert!(bench.host.snapshot().force.unbounded);
    bench.is_truthful_since(mark, "a module was left out");
}

#[test]
fn what_cannot_be_left_out_is_named() {
    let mut bench = small().in_use();
    let all: Vec<(u8, u8)> = (0..6).map(|m| (13, m)).chain((0..2).map(|m| (12, m))).collect();
    for (leave_out, expected) in [(vec![(13, 9)], "no module 9 on board 13"), (all, "every module is left out")] {
        let reply = bench.ask(Command::StartSession {
            patch: String::new(),
            target: None,
            branches: None,
            confirmed_by: None,
            leave_out,
        });
        let problem = format!("{reply:?}");
        assert!(problem.contains(expected) && problem.contains("leave_out"), "{problem}");
        assert!(bench.host.sessions.is_empty());
    }
}
