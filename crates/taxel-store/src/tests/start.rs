//! A large store: what a start reads of it, and how the rest is proven.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use rusqlite::Connection;
use taxel_engine::Restored;
use taxel_engine::calibration::SessionState;
use taxel_engine::catalogue::StoreDamage;
use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;

use super::fixture::*;
use crate::db::Db;
use crate::pass::{Lost, Step};
use crate::writer::Writer;
use crate::{Quarantined, Retention, Store, StoreError, StoreEvent, beside};

/// For what must come, on a machine that is slow and busy.
const PATIENCE: Duration = Duration::from_secs(120);

/// So many model sets, the seventh active, and as many sessions that were laid aside.
fn grown(path: &Path, count: i64) -> Vec<ModelSet> {
    let (store, ..) = open(path);
    let sets: Vec<_> = (1..=count).map(model_set).collect();
    for (number, set) in (1..).zip(&sets) {
        write(&store, vec![Record::ModelSet(Arc::new(set.clone())), session(number, SessionState::Discarded)]).unwrap();
    }
    write(&store, vec![activated(&sets[6])]).unwrap();
    store.close().unwrap();
    sets
}

/// Opens a file as if it were large.
fn open_large(path: &Path) -> (Db, Restored, Vec<Quarantined>) {
    Db::open_proving(path, &Retention::default(), 0).unwrap()
}

/// The same, served.
fn serve_large(path: &Path) -> (Store, Restored, Vec<Quarantined>, Receiver<StoreEvent>) {
    let (db, restored, quarantined) = open_large(path);
    let (tell, told) = channel();
    let store = Store::start(db, quarantined.clone(), Box::new(move |event| drop(tell.send(event)))).unwrap();
    (store, restored, quarantined, told)
}

fn damage(path: &Path, statements: &str) {
    let other = Connection::open(path).unwrap();
    other.execute_batch("DROP TRIGGER model_sets_keep; DROP TRIGGER samples_keep").unwrap();
    other.execute_batch(statements).unwrap();
}

fn next_damage(events: &Receiver<StoreEvent>) -> StoreDamage {
    loop {
        if let StoreEvent::Damaged(damage) = events.recv_timeout(PATIENCE).unwrap() {
            return damage;
        }
    }
}

/// Proves all that a start has left, undisturbed; what was found.
fn prove_all(db: &mut Db) -> Vec<Lost> {
    let mut lost = Vec::new();
    while !db.is_proven() {
        if let Step::Found(finding) = db.prove_next(|| false) {
            db.note(&finding);
            lost.push(finding.lost);
        }
    }
    lost
}

#[test]
fn a_start_reads_the_active_sets_alone_and_lists_all_of_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 40);
    let (db, restored, quarantined) = open_large(&path);
    assert_eq!((db.texts_read, quarantined), (1, vec![]));
    let listed: Vec<_> = restored.model_sets.iter().map(|set| set.summary().clone()).collect();
    assert_eq!(listed, sets.iter().map(SetSummary::of).collect::<Vec<_>>());
    let at_hand: Vec<_> = restored.model_sets.iter().filter_map(|set| set.at_hand.clone()).collect();
    assert_eq!(format!("{at_hand:?}"), format!("{:?}", [&sets[6]]));
    assert_eq!((restored.sessions.len(), restored.active.len()), (40, 1));
    db.close().unwrap();
    let (mut db, restored, _) = open_large(&path);
    assert_eq!(prove_all(&mut db), []);
    assert_eq!(sets_in(&db, &restored), sets.iter().map(|set| format!("{set:?}")).collect::<Vec<_>>());
}

#[test]
fn an_index_that_is_missing_or_damaged_is_made_again_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 20);
    let without = "DELETE FROM set_index WHERE seq > 15; UPDATE set_index SET entry = '{}' WHERE seq = 3;
                   UPDATE set_index SET checksum = x'00' WHERE seq = 4";
    Connection::open(&path).unwrap().execute_batch(without).unwrap();
    let listed = |restored: &Restored| restored.model_sets.iter().map(|s| s.summary().clone()).collect::<Vec<_>>();
    let expected: Vec<_> = sets.iter().map(SetSummary::of).collect();
    let (db, restored, quarantined) = open_large(&path);
    assert_eq!((db.texts_read, listed(&restored)), (7 + 1, expected.clone()));
    assert_eq!(quarantined.len(), 2, "what is missing is none of the damage: {quarantined:?}");
    // Killed: what was made is in the log.
    let killed = tempfile::tempdir().unwrap();
    let copy = killed.path().join("store.db");
    std::fs::copy(&path, &copy).unwrap();
    std::fs::copy(beside::wal(&path), beside::wal(&copy)).unwrap();
    std::fs::copy(beside::open_mark(&path), beside::open_mark(&copy)).unwrap();
    db.close().unwrap();
    for path in [path, copy] {
        let (db, restored, quarantined) = open_large(&path);
        assert_eq!((db.texts_read, listed(&restored), quarantined), (1, expected.clone(), vec![]));
        db.close().unwrap();
    }
}

#[test]
fn a_damaged_set_is_told_when_it_is_asked_for_and_can_be_imported_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 10);
    damage(
        &path,
        "UPDATE model_sets SET json = CAST(replace(CAST(json AS TEXT), '69.9', '69.8') AS BLOB) WHERE seq = 3",
    );
    let (store, _, quarantined, events) = serve_large(&path);
    assert_eq!(quarantined, [], "it was not looked at");
    let id = sets[2].id.clone();
    let findings = "its hash is not that of its content".to_owned();
    let expected = StoreError::DamagedModelSet { model_set: id.clone(), findings };
    assert_eq!(set_of(&store, &id).unwrap_err(), expected);
    let told = next_damage(&events);
    assert_eq!((told.model_sets.as_slice(), told.problems.len()), ([id.clone()].as_slice(), 1));
    assert!(told.problems[0].contains(&id) && told.problems[0].contains("hash"), "{told:?}");
    let unknown = StoreError::NoModelSet { model_set: id.clone() };
    assert_eq!(set_of(&store, &id).unwrap_err(), unknown, "it is as good as not there");
    write(&store, vec![Record::ModelSet(Arc::new(sets[2].clone())), activated(&sets[2])]).unwrap();
    assert_eq!(format!("{:?}", set_of(&store, &id).unwrap()), format!("{:?}", sets[2]));
    store.close().unwrap();
    let (_, restored, quarantined) = open_large(&path);
    assert_eq!((restored.model_sets.len(), quarantined.len()), (10, 1), "the damaged row stays reported");
    assert_eq!(restored.active, [(PATCH.to_owned(), id)]);
}

#[test]
fn damage_that_nobody_asks_for_is_found_while_the_store_is_open() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    damage(
        &path,
        "UPDATE model_sets SET json = x'7b7d' WHERE seq = 1; UPDATE samples SET counts = x'00' WHERE idx = 7",
    );
    let (store, restored, quarantined, events) = serve_large(&path);
    assert_eq!((restored.sessions[1].state, quarantined), (SessionState::Interrupted, vec![]));
    assert_eq!((restored.sessions[1].accepted, restored.sessions[1].ramps), (40, 1));
    let first = next_damage(&events);
    assert_eq!(first.model_sets, [sets[0].id.clone()]);
    let second = next_damage(&events);
    assert_eq!(second.problems.len(), 2, "all that was found is told each time");
    assert!(second.sessions[0].0 == 2 && second.sessions[0].1.contains("sample 7"), "{second:?}");
    assert_eq!(format!("{:?}", set_of(&store, &sets[1].id).unwrap()), format!("{:?}", sets[1]));
    store.close().unwrap();
    assert_eq!(events.iter().filter(|event| matches!(event, StoreEvent::Damaged(_))).count(), 0, "each once");
}

#[test]
fn a_session_of_many_samples_is_proven_in_parts() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    write(&store, (40..2_500).map(|index| sample_record(2, index)).collect()).unwrap();
    store.close().unwrap();
    let (mut db, ..) = open_large(&path);
    assert_eq!(prove_all(&mut db), []);
    db.close().unwrap();
    damage(&path, "UPDATE samples SET counts = x'00' WHERE idx = 2400");
    let (mut db, ..) = open_large(&path);
    assert_eq!(prove_all(&mut db), [Lost::Samples(2)]);
}

#[test]
fn a_look_at_the_structure_stops_when_work_comes_and_begins_anew() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path, 40);
    let (mut db, ..) = open_large(&path);
    let disturbed = (0..1_000).map(|_| db.prove_next(|| true)).find(|step| !matches!(step, Step::Sound));
    assert!(matches!(disturbed, Some(Step::Disturbed)) && !db.is_proven(), "{disturbed:?}");
    assert_eq!(prove_all(&mut db), []);
}

/// A link between pages that is broken is no row that is wrong: only the look at the structure finds it.
fn break_structure(path: &Path) {
    let other = Connection::open(path).unwrap();
    other.execute_batch("DROP TRIGGER model_sets_stay; DELETE FROM model_sets WHERE seq = 40").unwrap();
    other.execute_batch("DELETE FROM set_index WHERE seq = 40").unwrap();
    drop(other); // its pages are free now
    let mut bytes = std::fs::read(path).unwrap();
    let free = u32::from_be_bytes(bytes[32..36].try_into().unwrap());
    assert!(free > 0, "there are free pages");
    bytes[32..36].copy_from_slice(&2_u32.to_be_bytes()); // a page of a table is called free
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn a_file_that_is_found_damaged_while_it_is_open_is_looked_at_whole_by_the_next_start() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 40);
    break_structure(&path);
    let (mut db, restored, _) = open_large(&path);
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[6].id.clone())], "the force goes on");
    assert_eq!(prove_all(&mut db), [Lost::Structure]);
    assert!(beside::doubt_mark(&path).exists());
    drop(db);
    let (db, restored, quarantined) = open_large(&path);
    assert!(quarantined.iter().any(|found| found.reason.contains("damaged-1")), "{quarantined:?}");
    assert_eq!((restored.active.len(), restored.model_sets.len()), (1, 39));
    assert!(!beside::doubt_mark(&path).exists());
    db.close().unwrap();
}

/// Page of the tally's table that has sessions' rows alone: a start that is not to delete anything reads none of them.
fn page_of_sessions_tally(bytes: &[u8]) -> usize {
    const LEAF_OF_AN_INDEX: u8 = 0x0a;
    let holds = |page: &[u8], text: &str| page.windows(text.len()).any(|window| window == text.as_bytes());
    let is_it = |page: &[u8]| {
        page[0] == LEAF_OF_AN_INDEX
            && holds(page, "ramps of session 1")
            && !["model sets", "sessions", "activations"].iter().any(|name| holds(page, name))
    };
    bytes.chunks(4096).position(is_it).unwrap()
}

/// A store of 300 sessions, where the tally of some cannot be read.
fn grown_with_a_broken_tally(path: &Path) -> Vec<ModelSet> {
    let sets = grown(path, 10);
    let (store, ..) = open(path);
    for number in 11..=300 {
        write(&store, vec![session(number, SessionState::Discarded), ramp(number, 0)]).unwrap();
    }
    store.close().unwrap();
    let mut bytes = std::fs::read(path).unwrap();
    let broken = page_of_sessions_tally(&bytes);
    bytes[broken * 4096] = 0;
    std::fs::write(path, &bytes).unwrap();
    sets
}

#[test]
fn damage_that_only_deleting_meets_refuses_no_start() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown_with_a_broken_tally(&path);
    let (db, restored, quarantined) = open_large(&path);
    assert_eq!((restored.sessions.len(), quarantined), (300, vec![]), "a start does not read that page");
    db.close().unwrap();
    let limits = Retention { sessions: Some(200), ..Retention::default() };
    let (db, restored, quarantined) = Db::open_proving(&path, &limits, 0).unwrap();
    assert!(quarantined.iter().any(|found| found.reason.contains("damaged-1")), "{quarantined:?}");
    assert_eq!(restored.problems.len(), quarantined.len().min(21));
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[6].id.clone())], "the force goes on");
    assert_eq!((restored.model_sets.len(), restored.sessions.len()), (10, 200));
    assert!(!beside::doubt_mark(&path).exists());
    db.close().unwrap();
    let (db, restored, _) = Db::open_proving(&path, &limits, 0).unwrap();
    assert_eq!((restored.active.len(), restored.sessions.len()), (1, 200));
    assert!(!beside::beside(&path, ".damaged-2").exists());
    db.close().unwrap();
}

#[test]
fn a_write_that_meets_damage_ends_all_writing_and_the_next_start_mends_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown_with_a_broken_tally(&path);
    let (store, ..) = serve_large(&path);
    let refused = (11..=300).find_map(|number| write(&store, vec![ramp(number, 1)]).err());
    assert!(matches!(refused, Some(StoreError::Corrupt(_))), "{refused:?}");
    assert!(matches!(store.close(), Err(StoreError::Corrupt(_))));
    assert!(beside::doubt_mark(&path).exists());
    let (db, restored, quarantined) = open_large(&path);
    assert!(quarantined.iter().any(|found| found.reason.contains("damaged-1")), "{quarantined:?}");
    assert_eq!((restored.active.len(), restored.sessions.len()), (1, 300));
    db.close().unwrap();
}

#[test]
fn nothing_more_is_called_stored_once_the_file_is_found_damaged() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 40);
    break_structure(&path);
    let (store, _, _, events) = serve_large(&path);
    let failed = loop {
        if let StoreEvent::Failed(why) = events.recv_timeout(PATIENCE).unwrap() {
            break why;
        }
    };
    assert!(failed.contains("damaged") && failed.contains("the force goes on, and a restart"), "{failed}");
    let refused = write(&store, vec![activated(&sets[1])]).unwrap_err();
    assert_eq!(refused, StoreError::ReadOnly { reason: failed });
    assert!(matches!(store.close(), Err(StoreError::Corrupt(_))));
    let (db, restored, quarantined) = open_large(&path);
    assert!(quarantined.iter().any(|found| found.reason.contains("damaged-1")), "{quarantined:?}");
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[6].id.clone())]);
    db.close().unwrap();
}

#[test]
fn nothing_is_left_to_be_proven_once_the_store_has_failed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path, 10);
    let mut writer = Writer::new(open_large(&path).0, Vec::new(), Box::new(|_| ()));
    assert!(writer.until_proof().is_some());
    writer.fail(StoreError::Full("no room".to_owned()));
    assert_eq!(writer.until_proof(), None, "its thread would wake for it again and again");
    assert!(!beside::doubt_mark(&path).exists(), "a full disk is no damage");
}

#[test]
fn a_set_on_a_damaged_page_can_be_imported_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path, 10);
    let mut long = model_set(11);
    long.board_settings =
        (0..250).map(|board| format!("board {board}: period 50 ms, and words that take some room")).collect();
    let long = with_id(long);
    let (store, ..) = open(&path);
    write(&store, vec![Record::ModelSet(Arc::new(long.clone()))]).unwrap();
    store.close().unwrap();
    // This text alone takes a chain of pages. It ends too early now.
    let other = Connection::open(&path).unwrap();
    let second = "SELECT pageno FROM dbstat WHERE name = 'model_sets' AND path LIKE '%+000001'";
    let page: usize = other.query_row(second, [], |row| row.get(0)).unwrap();
    drop(other);
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[(page - 1) * 4096..][..4].fill(0);
    std::fs::write(&path, bytes).unwrap();
    let (mut db, ..) = open_large(&path);
    assert!(matches!(db.set_text(&long.id), Err(StoreError::Corrupt(_))));
    db.write([Record::ModelSet(Arc::new(long.clone())), activated(&long)].iter()).unwrap();
    assert!(db.set_text(&long.id).is_ok());
    db.close().unwrap();
    let (db, restored, quarantined) = open_large(&path);
    assert_eq!(restored.active, [(PATCH.to_owned(), long.id)], "{quarantined:?}");
    assert_eq!(restored.model_sets.len(), 11);
    db.close().unwrap();
}

#[test]
fn a_set_that_was_imported_again_is_not_given_up_for_its_damaged_row() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = grown(&path, 10);
    damage(&path, "UPDATE model_sets SET json = x'7b7d' WHERE seq = 3");
    let (mut db, ..) = open_large(&path);
    db.write([Record::ModelSet(Arc::new(sets[2].clone()))].iter()).unwrap();
    assert_eq!(prove_all(&mut db), []);
    assert!(db.set_text(&sets[2].id).is_ok());
    db.write([activated(&sets[2])].iter()).unwrap();
    db.close().unwrap();
}
