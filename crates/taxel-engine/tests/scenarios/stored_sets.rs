//! Model sets that are in the store and not in memory.

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
fn damage_that_the_store_finds_is_in_the_health_and_can_be_mended_by_an_import() {
    let (mut bench, _) = with_another_stored("m-other");
    let problems = vec!["model set m-other is damaged on disk and not used".to_owned()];
    bench.host.store_damaged(problems.clone());
    bench.seconds(1.0);
    assert_eq!(bench.host.health().store.damage, problems);
    assert!(bench.host.health().problems.contains(&problems[0]));
    assert!(bench.refused(activate("m-other")).contains("damaged on disk"));
    bench.import(other("m-other"));
    bench.activate("m-other").unwrap();
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
