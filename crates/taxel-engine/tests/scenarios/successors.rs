//! A further ramp after a session whose models are in use: a session of its own, with the samples of that one.

use crate::prelude::*;

/// Session 1 to 30 kPa, in use, the bag vented.
fn in_use() -> Bench {
    let (mut bench, _) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    bench
}

const RAMP: Command = Command::StartRamp { session: 1 };

#[test]
fn another_ramp_after_a_session_in_use_begins_one_with_its_samples_and_leaves_it_as_it_is() {
    let mut bench = in_use();
    let first = bench.host.catalogue.sessions[0].clone();
    let samples = bench.host.disk.samples[&1].clone();
    let view = session_of(bench.ask(RAMP));
    assert_eq!((view.number, view.predecessor, view.state), (2, Some(1), SessionState::Taring));
    assert_eq!((view.accepted, view.ramps, view.durable), (first.accepted, 1, 0), "nothing of it was on disk before");
    assert_eq!((view.target_kpa, view.branches), (first.target_kpa, first.branches));
    let inherited = bench.host.disk.samples[&2].clone();
    assert_eq!((&inherited.samples, &inherited.ramps), (&samples.samples, &samples.ramps));

    bench.until_state(30.0, SessionState::Ramping);
    bench.ramp(74.0, 4.0);
    bench.until_pressure(40.0);
    bench.finish(2);
    let view = bench.host.session().clone();
    assert!(view.number == 2 && view.ramps == 2 && view.accepted > first.accepted + 100, "{view:?}");
    let all = bench.host.disk.samples[&2].clone().samples;
    assert_eq!((&all[..samples.samples.len()], all.len() as u64), (samples.samples.as_slice(), view.accepted));
    let set = bench.host.newest_set();
    assert_eq!((set.session, Some(set.id.as_str())), (Some(2), view.model_set.as_deref()));
    let repeated = set.taxels.iter().filter(|model| model.quality.repeatability_kpa.is_some()).count();
    assert!(repeated >= 70, "the fit is over both ramps: {repeated}");

    assert_eq!(bench.host.catalogue.sessions[0], first, "the session in use");
    assert_eq!(bench.host.disk.samples[&1].clone().samples, samples.samples);
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), first.model_set.as_deref());
    bench.activate(&set.id).unwrap();
    let states: Vec<SessionState> = bench.host.catalogue.sessions.iter().map(|view| view.state).collect();
    assert_eq!(states, [SessionState::Review, SessionState::Active]);
}

#[test]
fn a_session_that_goes_out_of_use_while_its_samples_are_read_goes_on_itself() {
    let mut bench = in_use();
    bench.import(say::other("m-other"));
    bench.host.disk_is_slow = true;
    let request = bench.host.command(RAMP);
    let activation = bench.host.command(say::activate("m-other"));
    bench.host.commit(Ok(()));
    assert!(bench.host.reply(activation).unwrap().is_ok());
    bench.host.load();
    let view = session_of(bench.host.reply(request).unwrap());
    assert_eq!((view.number, view.state, view.ramps), (1, SessionState::Taring, 1));
}

#[test]
fn a_successor_that_cannot_begin_leaves_nothing_behind() {
    let mut bench = in_use();
    let sessions = bench.host.catalogue.sessions.clone();
    bench.ramp(20.0, 8.0);
    bench.seconds(4.0);
    let why = bench.refused(RAMP);
    assert!(why.contains("presses on the skin: vent it"), "{why}");
    bench.vent(5.0);
    bench.host.disk_is_slow = true;
    let late = bench.host.command(RAMP);
    let begun = bench.host.command(say::start());
    assert!(bench.host.reply(begun).unwrap().is_ok());
    bench.host.load();
    let Some(Err(Rejection::FailedPrecondition(_, why))) = bench.host.reply(late) else { panic!("not refused") };
    assert!(why.contains("session 2 is TARING; finish or abort it first"), "{why}");
    session_of(bench.ask(Command::AbortSession { session: 2, reason: None }));
    assert_eq!(bench.host.catalogue.sessions.len(), 2);
    assert_eq!(bench.host.catalogue.sessions[0], sessions[0]);
}
