//! Model sets that are in the store and not in memory.

use taxel_engine::catalogue::StoreDamage;

use crate::prelude::*;
use crate::say::{activate, delete_set, other};

/// A second set of the small skin, stored but not in memory.
fn with_another_stored(id: &str) -> (Bench, Arc<ModelSet>) {
    let other = other(id);
    let mut restored = small().restored();
    restored.model_sets.push(KnownSet::stored(SetSummary::of(&other)));
    let mut bench = small().listening(restored, |_| ());
    bench.seconds(0.5);
    (bench, other)
}

#[test]
fn a_set_that_is_not_in_memory_is_read_and_comes_into_use_when_that_is_on_disk() {
    let (mut bench, other) = with_another_stored("m-other");
    let first = small().set.id.as_str();
    bench.host.disk.write(Record::ModelSet(other));
    bench.host.disk_is_slow = true;
    let request = bench.host.command(activate("m-other"));
    assert_eq!(bench.host.set_loads.len(), 1);
    bench.seconds(0.2);
    assert!(!bench.host.replied(request));
    bench.host.load_sets();
    bench.seconds(0.2);
    assert!(!bench.host.replied(request), "that it is in use is not on disk");
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some(first));
    bench.host.commit(Ok(()));
    assert!(matches!(bench.host.reply(request), Some(Ok(Done::Activated { .. }))));
    bench.host.disk_is_slow = false;
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some("m-other"));
    let before = bench.host.set_loads.len();
    bench.activate(first).unwrap();
    assert_eq!(bench.host.set_loads.len(), before, "what was in use lately is still in memory");
}

#[test]
fn what_changes_while_a_set_is_read_counts() {
    let (mut bench, other) = with_another_stored("m-other");
    bench.host.disk.write(Record::ModelSet(other));
    bench.host.disk_is_slow = true;
    let request = bench.host.command(activate("m-other"));
    let deletion = bench.host.command(delete_set("m-other"));
    bench.host.load_sets();
    let Some(Err(refused)) = bench.host.reply(request) else { panic!("not refused") };
    assert!(refused.to_string().contains("is being deleted"), "{refused}");
    bench.host.commit(Ok(()));
    assert!(matches!(bench.host.reply(deletion), Some(Ok(Done::Deleted))));
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some(small().set.id.as_str()));
}

#[test]
fn a_set_that_is_damaged_on_disk_or_was_gathered_with_other_modules_does_not_come_into_use() {
    let (mut bench, _) = with_another_stored("m-other");
    let why = bench.refused(activate("m-other"));
    assert!(why.contains("m-other") && why.contains("damaged on disk") && why.contains("import it again"), "{why}");
    let unfit =
        |set: &mut ModelSet| set.board_settings[0] = set.board_settings[0].replace("modules 0-5", "modules 0-4");
    bench.host.disk.write(Record::ModelSet(say::other_with("m-other", unfit)));
    let why = bench.refused(activate("m-other"));
    assert!(why.contains("modules 0-4 on board 13"), "{why}");
    assert_eq!(bench.host.catalogue.active[0].1.as_deref(), Some(small().set.id.as_str()));
}

#[test]
fn damage_that_the_store_finds_is_in_the_health_and_what_is_lost_is_not_listed() {
    let (mut bench, _) = with_another_stored("m-other");
    let used = small().set.id.clone();
    let problems = vec!["model set m-other is damaged on disk and not used".to_owned()];
    let model_sets = vec!["m-other".to_owned(), used.clone()];
    bench.host.store_damaged(StoreDamage { problems: problems.clone(), model_sets, sessions: Vec::new() });
    bench.seconds(1.0);
    assert_eq!(bench.host.health().store.damage, problems);
    assert!(bench.host.health().problems.contains(&problems[0]));
    let listed: Vec<_> = bench.host.catalogue.model_sets.iter().map(|set| set.id.as_str()).collect();
    assert_eq!(listed, [used.as_str()], "a set in use is whole in memory");
    assert!(matches!(bench.ask(activate("m-other")), Err(Rejection::NotFound(..))));
    bench.import(other("m-other"));
    bench.activate("m-other").unwrap();
}

/// One that was interrupted could only have gone on from its samples; the others have their models.
#[test]
fn an_interrupted_session_whose_samples_are_damaged_has_failed_and_no_other_has() {
    let states = [SessionState::Interrupted, SessionState::Review, SessionState::Interrupted];
    let session = |(number, state)| {
        Arc::new(SessionView { number, state, model_set: None, changed_wall_ns: 1, ..small().session.clone() })
    };
    let restored = Restored { sessions: (1..).zip(states).map(session).collect(), ..small().restored() };
    let mut bench = small().listening(restored, |_| ());
    bench.seconds(0.5);
    let sessions = [1, 2, 9].map(|number| (number, "a torn record".to_owned())).to_vec();
    bench.host.store_damaged(StoreDamage { problems: Vec::new(), model_sets: Vec::new(), sessions });
    bench.seconds(0.5);
    let listed = &bench.host.catalogue.sessions;
    let is: Vec<_> = listed.iter().map(|view| (view.number, view.state, view.changed_wall_ns > 1)).collect();
    let (failed, review) = (SessionState::Failed, SessionState::Review);
    assert_eq!(is, [(1, failed, true), (2, review, false), (3, SessionState::Interrupted, false)]);
    assert_eq!(listed[0].reason, "its samples are damaged on disk: a torn record");
}

#[test]
fn only_what_is_in_use_and_what_came_last_is_in_memory() {
    let (mut bench, _) = with_another_stored("m-other");
    let in_memory = |bench: &Bench| -> Vec<String> {
        let known = bench.host.catalogue.model_sets.iter();
        known.filter(|set| set.at_hand.is_some()).map(|set| set.id.to_string()).collect()
    };
    for id in ["m-8", "m-9"] {
        bench.import(other(id));
    }
    assert_eq!(bench.host.catalogue.model_sets.len(), 4);
    assert_eq!(in_memory(&bench), [small().set.id.as_str(), "m-9"]);
    bench.activate("m-9").unwrap();
    assert_eq!(in_memory(&bench), ["m-9"]);
}
