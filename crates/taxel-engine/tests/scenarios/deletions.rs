//! What is deleted, and what is not.

use crate::prelude::*;
use crate::say::{activate, delete_set, other, start};

fn known(bench: &Bench) -> Vec<&str> {
    bench.host.catalogue.model_sets.iter().map(|set| set.id.as_str()).collect()
}

#[test]
fn a_model_set_is_deleted_once_nothing_uses_it() {
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    bench.activate(&set).unwrap();
    let why = bench.refused(delete_set(&set));
    assert_eq!(why, format!("model set `{set}` is in use on patch `small`; activate another one first"));
    assert_eq!(bench.refused(Command::DeleteSession { session }), why, "nor is the session that it came from");
    bench.import(other("m-other"));
    bench.activate("m-other").unwrap();
    assert!(matches!(bench.ask(delete_set(&set)), Ok(Done::Deleted)));
    assert_eq!(known(&bench), ["m-other"]);
    for command in [delete_set(&set), activate(&set)] {
        let unknown = Rejection::NotFound(ErrorReason::ModelSetUnknown, format!("model set `{set}`"));
        assert_eq!(bench.ask(command).unwrap_err(), unknown);
    }
    let view = &bench.host.catalogue.sessions[0];
    assert_eq!((view.number, view.state), (session, SessionState::Review), "its session stays");
}

#[test]
fn neither_an_open_session_nor_its_models_are_deleted() {
    let (mut bench, session) = ramping(30.0);
    assert_eq!(bench.refused(Command::DeleteSession { session }), "session 1 is RAMPING; abort it first");
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    session_of(bench.ask(Command::StartRamp { session }));
    let why = bench.refused(delete_set(&set));
    assert_eq!(why, format!("`{set}` is of session 1, which is TARING; finish or abort that first"));
    assert_eq!(known(&bench), [&*set]);
}

#[test]
fn a_deletion_takes_effect_when_it_is_on_disk_and_a_refused_one_has_none() {
    let (mut bench, session) = in_review(30.0);
    bench.host.disk_is_slow = true;
    for refused in [true, false] {
        let deletion = bench.host.command(Command::DeleteSession { session });
        bench.seconds(0.1);
        assert!(!bench.host.replied(deletion));
        assert_eq!(bench.host.catalogue.sessions.len(), 1, "it is there until the disk has it");
        for command in
            [Command::StartRamp { session }, Command::DiscardSession { session }, Command::DeleteSession { session }]
        {
            assert_eq!(bench.refused(command), "session 1 is being deleted: ask again");
        }
        if refused {
            bench.host.commit(Err("no space".to_owned()));
            let Some(Err(Rejection::Unavailable(_, why))) = bench.host.reply(deletion) else { panic!("acknowledged") };
            assert!(why.contains("nothing has changed: no space"), "{why}");
            assert_eq!(bench.host.catalogue.sessions[0].state, SessionState::Review);
            assert!(bench.host.sessions_gone.is_empty());
        } else {
            bench.host.commit(Ok(()));
            assert!(matches!(bench.host.reply(deletion), Some(Ok(Done::Deleted))));
        }
    }
    bench.host.disk_is_slow = false;
    assert!(bench.host.catalogue.sessions.is_empty());
    assert_eq!(bench.host.sessions_gone, [0], "readers of the patch's session learn of it");
    assert_eq!(
        bench.ask(Command::StartRamp { session }).unwrap_err(),
        Rejection::NotFound(ErrorReason::SessionUnknown, "session 1".to_owned())
    );
    let shown = bench.host.sessions.len();
    bench.host.durable(session, 1_000);
    bench.seconds(1.0);
    assert_eq!(bench.host.sessions.len(), shown, "nothing more is shown of it");
    assert_eq!(known(&bench).len(), 1, "its models stay");
    assert_eq!(session_of(bench.ask(start())).number, 2, "its number is not used again");
}

#[test]
fn what_is_being_activated_is_not_deleted_and_what_is_being_deleted_not_activated() {
    let (mut bench, session) = in_review(30.0);
    let set = bench.host.session().model_set.clone().unwrap();
    bench.host.disk_is_slow = true;
    let activation = bench.host.command(activate(&set));
    for command in [delete_set(&set), Command::DeleteSession { session }] {
        assert_eq!(bench.refused(command), format!("model set `{set}` is being activated: ask again"));
    }
    bench.host.commit(Err("no space".to_owned()));
    assert!(bench.host.reply(activation).unwrap().is_err());
    let deletion = bench.host.command(delete_set(&set));
    for command in [activate(&set), delete_set(&set)] {
        assert_eq!(bench.refused(command), format!("model set `{set}` is being deleted: ask again"));
    }
    bench.host.commit(Ok(()));
    assert!(matches!(bench.host.reply(deletion), Some(Ok(Done::Deleted))));
    assert!(known(&bench).is_empty());
}

/// A session whose samples are being read is not open yet.
#[test]
fn a_session_that_is_deleted_while_its_samples_are_read_does_not_go_on() {
    let (mut bench, session) = in_review(30.0);
    let newer = session_of(bench.ask(start())).number;
    session_of(bench.ask(Command::AbortSession { session: newer, reason: None }));
    bench.host.disk_is_slow = true;
    let ramp = bench.host.command(Command::StartRamp { session });
    let deletion = bench.host.command(Command::DeleteSession { session });
    bench.host.commit(Ok(()));
    bench.host.load();
    let unknown = Rejection::NotFound(ErrorReason::SessionUnknown, "session 1".to_owned());
    assert_eq!(bench.host.reply(ramp).unwrap().unwrap_err(), unknown);
    assert!(bench.host.reply(deletion).unwrap().is_ok());
    let ramps = |record: &Record| matches!(record, Record::Session(view) if view.number == session && view.ramps > 1);
    assert!(!bench.host.records.iter().any(ramps));
}

#[test]
fn what_the_store_found_damaged_is_a_problem_of_the_health() {
    let line = "model set m-1 is damaged on disk and not used: its hash is not that of its content".to_owned();
    let restored = Restored { problems: vec![line.clone()], ..Restored::default() };
    let mut bench = Bench::new(small_world(), plan(patch_plan(&small().skin)), restored);
    bench.seconds(1.0);
    assert_eq!(bench.host.health().problems, [line]);
}
