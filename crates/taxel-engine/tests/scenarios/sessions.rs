//! Commands at the wrong time, with wrong names, and after a restart.

use std::sync::Arc;
use std::time::Duration;

use taxel_engine::Restored;
use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, Done, ErrorReason, Rejection};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use taxel_engine::snapshot::ForceState;
use taxel_sim::PumpCommand;

use crate::bench::{Bench, Disk, session_of};
use crate::rig::{patch_plan, plan, small_world};
use crate::shared::small;

pub fn start() -> Command {
    Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    }
}

/// A session that ramps.
pub fn ramping(kpa: f64) -> (Bench, u64) {
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), Restored::default());
    bench.brought_up();
    let number = bench.start_session(None);
    bench.ramp(74.0, 4.0);
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= kpa));
    (bench, number)
}

pub fn in_review(kpa: f64) -> (Bench, u64) {
    let (mut bench, session) = ramping(kpa);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(5.0);
    (bench, session)
}

#[test]
fn a_command_in_the_wrong_state_is_refused_and_names_the_state() {
    let (mut bench, session) = ramping(25.0);
    let tare = || Command::Tare { patch: String::new(), confirmed_by: Some("Ada".to_owned()) };
    let bring_up = || Command::BringUp { patch: String::new(), confirmed_by: None };
    for command in [start(), tare(), bring_up(), Command::StartRamp { session }, Command::DiscardSession { session }] {
        let why = bench.refused(command.clone());
        assert!(why.contains("session 1 is RAMPING"), "{command:?}: {why}");
    }
    assert_eq!(bench.host.session().state, SessionState::Ramping, "none of them did anything");
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    for command in [Command::FinishRamp { session }, Command::AbortSession { session }] {
        let why = bench.refused(command.clone());
        assert!(why.contains("session 1 is REVIEW"), "{command:?}: {why}");
    }
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    bench.until_state(1.0, SessionState::Active);
    for command in [Command::FinishRamp { session }, Command::AbortSession { session }] {
        let why = bench.refused(command.clone());
        assert!(why.contains("session 1 is ACTIVE"), "{command:?}: {why}");
    }
    // A further ramp would be a session of its own, once the bag is vented.
    let why = bench.refused(Command::StartRamp { session });
    assert!(why.contains("presses on the skin: vent it"), "{why}");
    let why = bench.refused(Command::DiscardSession { session });
    assert_eq!(why, "session 1 is ACTIVE and its models are in use; activate others first");
}

#[test]
fn what_does_not_exist_is_not_found_by_its_name() {
    let mut bench = small().in_use();
    let session = 77;
    for command in [
        Command::StartRamp { session },
        Command::FinishRamp { session },
        Command::AbortSession { session },
        Command::DiscardSession { session },
    ] {
        assert_eq!(
            bench.ask(command).unwrap_err(),
            Rejection::NotFound(ErrorReason::SessionUnknown, "session 77".to_owned())
        );
    }
    let elbow = || "elbow".to_owned();
    for command in [
        Command::Tare { patch: elbow(), confirmed_by: None },
        Command::BringUp { patch: elbow(), confirmed_by: None },
        Command::StartSession {
            patch: elbow(),
            target: None,
            branches: None,
            confirmed_by: None,
            leave_out: Vec::new(),
        },
        Command::Activate { patch: elbow(), model_set: small().set.id.clone(), expected: None },
    ] {
        let Err(Rejection::NotFound(_, what)) = bench.ask(command) else { panic!("there is no elbow") };
        assert!(what.contains("`elbow`") && what.contains("small"), "{what}");
    }
    let Err(Rejection::NotFound(_, what)) = bench.activate("m-0") else { panic!("there is no such set") };
    assert!(what.contains("`m-0`"), "{what}");
}

#[test]
fn a_target_that_no_bag_reaches_is_an_invalid_argument() {
    let mut bench = small().in_use();
    for target in [0.0, -5.0, f64::NAN, f64::INFINITY, 2_000.0] {
        let target = Some(taxel_skin::Kilopascal(target));
        let reply = bench.ask(Command::StartSession {
            patch: String::new(),
            target,
            branches: None,
            confirmed_by: None,
            leave_out: Vec::new(),
        });
        assert!(matches!(reply, Err(Rejection::InvalidArgument { field: "target_kpa", .. })), "{target:?}: {reply:?}");
    }
}

#[test]
fn an_activation_that_expects_another_set_is_refused() {
    let mut bench = small().in_use();
    let activate = |expected: &str| Command::Activate {
        patch: String::new(),
        model_set: small().set.id.clone(),
        expected: Some(expected.to_owned()),
    };
    let why = bench.refused(activate("m-other"));
    assert!(why.contains("expected `m-other`") && why.contains(&small().set.id), "{why}");
    let why = bench.refused(activate(""));
    assert!(why.contains(&small().set.id), "{why}");
    assert!(matches!(bench.ask(activate(&small().set.id)), Ok(Done::Activated { .. })));
}

#[test]
fn the_set_of_a_discarded_session_cannot_be_activated() {
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    session_of(bench.ask(Command::DiscardSession { session }));
    let Err(Rejection::FailedPrecondition(_, why)) = bench.activate(&set) else { panic!("it was activated") };
    assert!(why.contains("DISCARDED"), "{why}");
    assert_eq!(bench.host.state(), ForceState::Uncalibrated);
    assert_eq!(bench.host.catalogue.active[0].1, None);
}

/// Whether the file of a set says of which session it is, or of another, or when it was made: what is known of it stays.
#[test]
fn what_is_known_of_a_set_is_not_changed_by_its_file() {
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    let listed = |bench: &Bench| {
        let set = bench.host.catalogue.model_sets.iter().find(|known| known.id == *set).unwrap();
        (set.session, set.created_wall_ns)
    };
    let before = listed(&bench);
    assert_eq!(before.0, Some(session));
    let position = bench.host.catalogue.model_sets.iter().position(|known| known.id == *set).unwrap();
    let stored = bench.host.set(position);
    for (session, created_wall_ns) in [(None, before.1), (Some(7), 1)] {
        let file = ModelSet { session, created_wall_ns, ..ModelSet::clone(&stored) };
        bench.ask(Command::Import { model_set: Arc::new(file), insist: false }).unwrap();
        assert_eq!(listed(&bench), before);
    }
}

/// Only one session of a patch is ACTIVE; the one before it can then be laid aside.
#[test]
fn a_session_is_active_only_while_its_models_are_in_use() {
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    assert!(matches!(bench.activate(&set), Ok(Done::Activated { .. })));
    assert_eq!(bench.host.session().state, SessionState::Active);
    let why = bench.refused(Command::DiscardSession { session });
    assert_eq!(why, "session 1 is ACTIVE and its models are in use; activate others first");
    let imported =
        taxel_engine::model_set::ModelSet { id: "m-other".to_owned(), session: None, ..(*small().set).clone() };
    assert!(matches!(
        bench.ask(Command::Import { model_set: Arc::new(imported), insist: false }),
        Ok(Done::Imported { .. })
    ));
    assert!(matches!(bench.activate("m-other"), Ok(Done::Activated { .. })));
    assert_eq!(bench.host.session().state, SessionState::Review);
    assert_eq!(session_of(bench.ask(Command::DiscardSession { session })).state, SessionState::Discarded);
}

/// The last samples reach the disk after the fit; readers still learn of it.
#[test]
fn samples_that_reach_the_disk_after_the_ramp_are_shown() {
    let (mut bench, number) = in_review(30.0);
    let accepted = bench.host.session().accepted;
    bench.host.durable(number, accepted);
    bench.seconds(0.5);
    assert_eq!(bench.host.session().durable, accepted);
}

/// All but the labels of a run.
pub fn content(set: &ModelSet) -> String {
    format!("{:?} {:?} {:?} {:?}", set.taxels, set.baseline, set.pressure_max_kpa, set.method)
}

#[test]
fn an_interrupted_session_gives_the_same_models_as_an_uninterrupted_one() {
    let (mut bench, session) = ramping(40.0);
    let disk = Disk::after_a_crash(&bench.host);
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
    let uninterrupted = bench.host.set(0);

    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    resumed.seconds(0.5);
    let listed = &resumed.host.catalogue.sessions[0];
    assert_eq!((listed.number, listed.state), (session, SessionState::Interrupted));
    let view = session_of(resumed.ask(Command::FinishRamp { session }));
    assert_eq!(view.accepted, bench.host.session().accepted);
    resumed.until_state(1.0, SessionState::Review);
    let set = resumed.host.set(0);
    assert_eq!(content(&set), content(&uninterrupted));
    assert_eq!(set.id, uninterrupted.id);
}

#[test]
fn an_interrupted_session_is_aborted_without_its_samples() {
    let (bench, session) = ramping(30.0);
    let mut disk = Disk::after_a_crash(&bench.host);
    disk.samples.clear();
    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    let view = session_of(resumed.ask(Command::AbortSession { session }));
    assert_eq!((view.state, view.reason.as_str()), (SessionState::Aborted, "an operator aborted it"));
    assert_eq!(resumed.host.catalogue.sessions[0].state, SessionState::Aborted);
}

#[test]
fn a_session_whose_samples_are_damaged_or_of_another_layout_cannot_go_on() {
    let (bench, session) = ramping(30.0);
    let mut disk = Disk::after_a_crash(&bench.host);
    let samples = disk.samples.remove(&session).unwrap();
    let mut resumed = Bench::after(bench.world.clone(), bench.host.plan.clone(), disk);
    let why = resumed.refused(Command::FinishRamp { session });
    assert_eq!(why, "session 1 cannot go on, its samples are damaged on disk: they are not there; start a new one");
    let mut narrow = samples;
    narrow.samples.iter_mut().for_each(|sample| sample.counts = sample.counts.counts().slice(0..70).into());
    resumed.host.stored.insert(session, narrow);
    let why = resumed.refused(Command::FinishRamp { session });
    assert!(why.contains("session 1 is of another layout of patch `small`"), "{why}");
    assert!(resumed.host.sessions.is_empty(), "the patch holds no session");
}

/// Time passes while samples are read from disk, and everything may change in it.
#[test]
fn what_changed_while_samples_were_read_counts() {
    let (bench, session) = ramping(30.0);
    let mut world = bench.world.clone();
    world.pump(PumpCommand::Vent);
    world.advance(bench.now() + Duration::from_secs(20), &mut Vec::new());
    let mut resumed = Bench::after(world, bench.host.plan.clone(), Disk::after_a_crash(&bench.host));
    resumed.brought_up();
    resumed.host.disk_is_slow = true;
    let first = resumed.host.command(Command::StartRamp { session });
    let second = resumed.host.command(Command::StartRamp { session });
    resumed.seconds(0.5);
    assert!(!resumed.host.replied(first) && resumed.host.sessions.is_empty(), "nothing happens before they are there");
    resumed.host.load();
    assert_eq!(session_of(resumed.host.reply(first).unwrap()).state, SessionState::Taring);
    let Some(Err(Rejection::FailedPrecondition(_, why))) = resumed.host.reply(second) else { panic!("not refused") };
    assert!(why.contains("session 1 is TARING"), "{why}");
    session_of(resumed.ask(Command::AbortSession { session }));

    let begun = resumed.host.command(start());
    let other = resumed.host.session().number;
    assert!(resumed.host.reply(begun).unwrap().is_ok());
    session_of(resumed.ask(Command::AbortSession { session: other }));
    let late = resumed.host.command(Command::StartRamp { session });
    let begun = resumed.host.command(start());
    assert!(resumed.host.reply(begun).unwrap().is_ok());
    resumed.host.load();
    let Some(Err(Rejection::FailedPrecondition(_, why))) = resumed.host.reply(late) else { panic!("not refused") };
    assert!(why.contains("session 3 is TARING; finish or abort it first"), "{why}");
}

#[test]
fn a_session_that_gave_way_to_a_newer_one_takes_another_ramp() {
    let (mut bench, session) = in_review(30.0);
    let accepted = bench.host.session().accepted;
    let newer = session_of(bench.ask(start())).number;
    session_of(bench.ask(Command::AbortSession { session: newer }));
    let view = session_of(bench.ask(Command::StartRamp { session }));
    assert_eq!((view.state, view.accepted, view.ramps), (SessionState::Taring, accepted, 1));
}

#[test]
fn an_interrupted_session_takes_another_ramp() {
    let (bench, session) = ramping(30.0);
    let accepted = bench.host.samples(session).len() as u64;
    let mut world = bench.world.clone();
    world.pump(PumpCommand::Vent); // before the boards take their zero anew
    world.advance(bench.now() + Duration::from_secs(20), &mut Vec::new());
    let mut resumed = Bench::after(world, bench.host.plan.clone(), Disk::after_a_crash(&bench.host));
    resumed.brought_up();
    session_of(resumed.ask(Command::StartRamp { session }));
    resumed.until_state(30.0, SessionState::Ramping);
    resumed.ramp(40.0, 4.0);
    resumed.seconds(8.0);
    resumed.ask(Command::FinishRamp { session }).unwrap();
    resumed.until_state(1.0, SessionState::Review);
    let view = resumed.host.session();
    assert!(view.ramps == 2 && view.accepted > accepted + 100, "{view:?}");
    let new = resumed.host.records.iter().find_map(|record| match record {
        Record::Sample { index, sample, .. } => Some((*index, sample.ramp)),
        _ => None,
    });
    assert_eq!(new, Some((accepted, 1)), "the first new sample follows the last old one");
}

#[test]
fn a_session_in_review_takes_another_ramp_after_a_restart() {
    let (bench, session) = in_review(30.0);
    let accepted = bench.host.session().accepted;
    let mut world = bench.world.clone();
    world.pump(PumpCommand::Vent);
    world.advance(bench.now() + Duration::from_secs(20), &mut Vec::new());
    let mut resumed = Bench::after(world, bench.host.plan.clone(), Disk::after_a_crash(&bench.host));
    resumed.brought_up();
    assert_eq!(resumed.host.catalogue.sessions[0].state, SessionState::Review);
    session_of(resumed.ask(Command::StartRamp { session }));
    resumed.until_state(30.0, SessionState::Ramping);
    resumed.ramp(40.0, 4.0);
    resumed.seconds(8.0);
    resumed.ask(Command::FinishRamp { session }).unwrap();
    resumed.until_state(1.0, SessionState::Review);
    let view = resumed.host.session();
    assert!(view.ramps == 2 && view.accepted > accepted + 100, "{view:?}");
}

#[test]
fn a_restart_with_an_active_set_gives_a_good_force_without_any_command() {
    for only_listens in [true, false] {
        let mut patch = patch_plan(&small().skin);
        if only_listens {
            patch.bring_up.clear();
        }
        let mut bench = Bench::new(small().world.clone(), plan(patch), small().restored());
        bench.until_force(5.0, ForceState::Ok);
        let snapshot = bench.host.snapshot();
        assert!(snapshot.force.total.unwrap().0 < 0.3, "{:?}", snapshot.force);
        assert_eq!(snapshot.force.model_set.as_deref(), Some(small().set.id.as_str()));
        let good = bench.host.snapshots.iter().filter(|s| s.force.state == ForceState::Ok).count();
        assert_eq!(good, 1, "no good force came before the full zero");
    }
}

#[test]
fn without_a_tare_at_start_a_restart_waits_for_one() {
    let mut patch = patch_plan(&small().skin);
    patch.tare.at_start = false;
    let mut bench = Bench::new(small().world.clone(), plan(patch), small().restored());
    bench.seconds(5.0);
    assert_eq!(bench.host.state(), ForceState::TareInvalid, "{}", bench.host.reasons());
    bench.tare(None).unwrap();
    bench.until_force(1.0, ForceState::Ok);
}
