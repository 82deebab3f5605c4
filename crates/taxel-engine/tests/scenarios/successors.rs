//! A further ramp after a session whose models are in use: a session of its own, with the samples of that one.

use std::time::Duration;

use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, Rejection};
use taxel_engine::record::Record;
use taxel_sim::PumpCommand;

use crate::bench::{Bench, Disk, session_of};
use crate::sessions::{in_review, start};

/// Session 1 to 30 kPa, in use, the bag vented.
fn in_use() -> Bench {
    let (mut bench, _) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    bench
}

const RAMP: Command = Command::StartRamp { session: 1 };

/// To 40 kPa and through the fit.
fn rise_and_fit(bench: &mut Bench, session: u64) {
    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(74.0, 4.0);
    bench.until(30.0, "pressure", |host| host.session().pressure_kpa.is_some_and(|p| p >= 40.0));
    bench.ask(Command::FinishRamp { session }).unwrap();
    bench.until_state(1.0, SessionState::Review);
}

#[test]
fn another_ramp_after_a_session_in_use_begins_one_with_its_samples_and_leaves_it_as_it_is() {
    let mut bench = in_use();
    let first = bench.host.catalogue.sessions[0].clone();
    let samples = bench.host.on_disk(1).unwrap();
    let view = session_of(bench.ask(RAMP));
    assert_eq!((view.number, view.predecessor, view.state), (2, Some(1), SessionState::Taring));
    assert_eq!((view.accepted, view.ramps, view.durable), (first.accepted, 1, 0), "nothing of it was on disk before");
    assert_eq!((view.target_kpa, view.branches), (first.target_kpa, first.branches));
    let inherited = bench.host.on_disk(2).unwrap();
    assert_eq!((&inherited.samples, &inherited.ramps), (&samples.samples, &samples.ramps));

    rise_and_fit(&mut bench, 2);
    let view = bench.host.session().clone();
    assert!(view.number == 2 && view.ramps == 2 && view.accepted > first.accepted + 100, "{view:?}");
    let all = bench.host.on_disk(2).unwrap().samples;
    assert_eq!((&all[..samples.samples.len()], all.len() as u64), (samples.samples.as_slice(), view.accepted));
    let set = bench.host.newest_set();
    assert_eq!((set.session, Some(set.id.as_str())), (Some(2), view.model_set.as_deref()));
    let repeated = set.taxels.iter().filter(|model| model.quality.repeatability_kpa.is_some()).count();
    assert!(repeated >= 70, "the fit is over both ramps: {repeated}");

    assert_eq!(bench.host.catalogue.sessions[0], first, "the session in use");
    assert_eq!(bench.host.on_disk(1).unwrap().samples, samples.samples);
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), first.model_set.as_deref());
    bench.activate(&set.id).unwrap();
    let states: Vec<SessionState> = bench.host.catalogue.sessions.iter().map(|view| view.state).collect();
    assert_eq!(states, [SessionState::Review, SessionState::Active]);
}

#[test]
fn a_successor_that_cannot_begin_leaves_nothing_behind() {
    let mut bench = in_use();
    let sessions = bench.host.catalogue.sessions.clone();
    bench.ramp(20.0, 8.0);
    bench.seconds(4.0);
    let why = bench.refused(RAMP);
    assert!(why.contains("presses on the skin: vent it"), "{why}");
    bench.world.pump(PumpCommand::Vent);
    bench.seconds(5.0);
    bench.host.disk_is_slow = true;
    let late = bench.host.command(RAMP);
    let begun = bench.host.command(start());
    assert!(bench.host.reply(begun).unwrap().is_ok());
    bench.host.load();
    let Some(Err(Rejection::FailedPrecondition(_, why))) = bench.host.reply(late) else { panic!("not refused") };
    assert!(why.contains("session 2 is TARING; finish or abort it first"), "{why}");
    session_of(bench.ask(Command::AbortSession { session: 2 }));
    bench.host.disk_is_slow = false;
    bench.host.stored.clear();
    bench.host.records.retain(|record| !matches!(record, Record::Ramp { .. } | Record::Sample { .. }));
    let why = bench.refused(RAMP);
    assert!(why.contains("its samples are damaged on disk"), "{why}");
    assert_eq!(bench.host.catalogue.sessions.len(), 2);
    assert_eq!(bench.host.catalogue.sessions[0], sessions[0]);
    bench.host.store_failed("the disk is gone");
    assert!(matches!(bench.ask(RAMP), Err(Rejection::Unavailable(..))));
}

#[test]
fn a_session_that_goes_out_of_use_while_its_samples_are_read_goes_on_itself() {
    let mut bench = in_use();
    let own = bench.host.set(0);
    let other = taxel_engine::model_set::ModelSet { id: "m-other".to_owned(), session: None, ..(*own).clone() };
    bench.ask(Command::Import { model_set: other.into(), insist: false }).unwrap();
    bench.host.disk_is_slow = true;
    let request = bench.host.command(RAMP);
    let activation =
        bench.host.command(Command::Activate { patch: String::new(), model_set: "m-other".to_owned(), expected: None });
    bench.host.commit(Ok(()));
    assert!(bench.host.reply(activation).unwrap().is_ok());
    bench.host.load();
    let view = session_of(bench.host.reply(request).unwrap());
    assert_eq!((view.number, view.state, view.ramps), (1, SessionState::Taring, 1));
}

/// Neither session is held by a patch: the first after one restart, the successor after another.
#[test]
fn a_successor_begins_after_a_restart_and_goes_on_after_another() {
    let bench = in_use();
    let accepted = bench.host.catalogue.sessions[0].accepted;
    let restart = |bench: &Bench| {
        let mut world = bench.world.clone();
        world.pump(PumpCommand::Vent);
        world.advance(bench.now() + Duration::from_secs(20), &mut Vec::new());
        let mut disk = Disk::after_a_crash(&bench.host);
        disk.restored.model_sets = bench.host.catalogue.model_sets.clone();
        let patch = bench.host.plan.patches[0].patch.name().to_owned();
        disk.restored.active = vec![(patch, bench.host.catalogue.active[0].1.clone().unwrap())];
        let mut bench = Bench::after(world, bench.host.plan.clone(), disk);
        bench.brought_up();
        bench
    };
    let mut second = restart(&bench);
    assert_eq!(second.host.catalogue.sessions[0].state, SessionState::Active);
    let view = session_of(second.ask(RAMP));
    assert_eq!((view.number, view.predecessor, view.accepted), (2, Some(1), accepted));
    second.until_state(30.0, SessionState::Ramping);
    // What this run wrote is the successor alone; what is known of the first session is older.
    second.host.records.insert(0, Record::Session(second.host.catalogue.sessions[0].clone()));
    let mut third = restart(&second);
    let view = third.host.catalogue.sessions.iter().find(|view| view.number == 2).unwrap().clone();
    assert_eq!((view.state, view.predecessor), (SessionState::Interrupted, Some(1)));
    session_of(third.ask(Command::StartRamp { session: 2 }));
    rise_and_fit(&mut third, 2);
    let view = third.host.session();
    assert!(view.ramps >= 2 && view.accepted > accepted + 100, "{view:?}");
}
