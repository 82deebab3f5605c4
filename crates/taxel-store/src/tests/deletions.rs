//! What is deleted is gone from the disk, and nobody takes it for lost.

use std::fs;
use std::sync::Arc;

use rusqlite::Connection;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::SessionState;
use taxel_engine::record::{Record, Sample};

use super::fixture::*;
use crate::db::Db;
use crate::{StoreError, beside};

fn session_deleted(session: u64) -> Record {
    Record::SessionDeleted { session, wall_ns: 7 }
}

fn set_deleted(id: &str) -> Record {
    Record::ModelSetDeleted { model_set: id.to_owned(), wall_ns: 7 }
}

/// A sample whose counts are 64 bytes that nothing else has.
fn marked(index: u64) -> Record {
    let counts: Vec<u8> = (0..64).map(|k| MARK[k % MARK.len()] ^ (index as u8 & 1)).collect();
    Record::Sample { session: 3, index, sample: Sample { counts: counts.into(), ..sample(index) } }
}

const MARK: [u8; 11] = *b"zq9!xKvJ&4w";

/// Whether a file holds at least eleven bytes of the counts of any marked sample, or of the baseline of its ramp.
fn holds_marks(bytes: &[u8]) -> bool {
    let other = MARK.map(|byte| byte ^ 1);
    let mean = [1_234.567_89_f64.to_le_bytes(), 9.876_543_21_f64.to_le_bytes()].concat();
    bytes.windows(MARK.len()).any(|window| window == MARK || window == other)
        || bytes.windows(mean.len()).any(|window| window == mean)
}

#[test]
fn a_deleted_session_is_gone_from_the_disk_and_is_not_taken_for_lost() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let log = dir.path().join("store.db-wal");
    filled(&path);
    let (store, ..) = open(&path);
    let baseline = vec![TaxelBaseline { mean: 1_234.567_89, noise: 9.876_543_21 }; 60];
    let mut records = vec![session(3, SessionState::Review), began(3, 0, baseline)];
    records.extend((0..2_000).map(marked));
    write(&store, records).unwrap();
    assert!(holds_marks(&fs::read(&path).unwrap()) || holds_marks(&fs::read(&log).unwrap()));
    write(&store, vec![session_deleted(3)]).unwrap();
    assert_eq!(samples_of(&store, 3).unwrap().samples, [], "all that follows the deletion finds it done");
    assert!(!holds_marks(&fs::read(&path).unwrap()), "in the file");
    assert!(!holds_marks(&fs::read(&log).unwrap()), "in the log");
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(quarantined, []);
    assert_eq!(restored.sessions.iter().map(|view| view.number).collect::<Vec<_>>(), [1, 2]);
    assert_eq!(restored.next_session, 4, "its number is not used again");
}

#[test]
fn the_space_of_what_was_deleted_is_given_back_at_the_next_start() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    let rest = model_set(0).baseline[0];
    write(&store, vec![session(1, SessionState::Aborted)]).unwrap();
    for ramp in 0..20 {
        write(&store, vec![began(1, ramp, vec![rest; 25_000])]).unwrap();
    }
    write(&store, vec![session_deleted(1)]).unwrap();
    store.close().unwrap();
    let before = fs::metadata(&path).unwrap().len();
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((restored.next_session, quarantined), (2, vec![]));
    store.close().unwrap();
    let after = fs::metadata(&path).unwrap().len();
    assert!(before > 8_000_000 && after < 200_000, "{before} bytes, then {after}");
}

#[test]
fn no_record_of_a_deleted_session_is_taken() {
    for record in [session(2, SessionState::Ramping), ramp(2, 0), sample_record(2, 0), session_deleted(2)] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![session_deleted(2)]).unwrap();
        write(&store, vec![record.clone()]).unwrap_err();
        drop(store.close());
        let (_, restored, quarantined) = Db::open(&path).unwrap();
        assert_eq!((restored.sessions.len(), quarantined), (1, vec![]), "{record:?}");
    }
    let store = crate::Store::in_memory(Box::new(|_| ())).unwrap();
    let refused = write(&store, vec![set_deleted("m-0")]).unwrap_err();
    assert!(matches!(&refused, StoreError::Unstorable { .. }), "{refused}");
}

#[test]
fn a_deleted_model_set_is_gone_and_its_old_activation_does_not_bring_it_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [first, second] = filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![set_deleted(&second.id)]).unwrap();
    store.close().unwrap();
    let bytes = fs::read(&path).unwrap();
    let json = br#""created_wall_ns":2,"#;
    assert!(!bytes.windows(json.len()).any(|window| window == json));
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!(quarantined, [], "its activation was not lost: it ended");
    assert_eq!(restored.active, [], "nor does the one before it come back");
    assert_eq!(restored.model_sets.iter().map(|set| set.id.as_str()).collect::<Vec<_>>(), [&first.id]);
    write(&store, vec![Record::ModelSet(Arc::new(second.clone()))]).unwrap();
    store.close().unwrap();
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((restored.model_sets.len(), restored.active, quarantined), (2, vec![], vec![]));
    write(&store, vec![activated(&second)]).unwrap();
    store.close().unwrap();
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((restored.active, quarantined), (vec![(PATCH.to_owned(), second.id.clone())], vec![]));
    // All of it once more: a set can come and go any number of times.
    write(&store, vec![activated(&first), set_deleted(&second.id), Record::ModelSet(Arc::new(second.clone()))])
        .unwrap();
    write(&store, vec![set_deleted(&second.id)]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!((restored.active, quarantined), (vec![(PATCH.to_owned(), first.id)], vec![]));
    assert_eq!(restored.model_sets.len(), 1);
}

/// A kill came before the plain file was written anew, and damage elsewhere has it looked at.
#[test]
fn a_set_that_was_deleted_is_not_taken_back_from_the_plain_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [_, second] = filled(&path);
    let plain = fs::read(beside::active(&path)).unwrap();
    let (store, ..) = open(&path);
    write(&store, vec![set_deleted(&second.id)]).unwrap();
    store.close().unwrap();
    fs::write(beside::active(&path), plain).unwrap();
    Connection::open(&path).unwrap().execute("UPDATE sessions SET checksum = x'00' WHERE number = 1", []).unwrap();
    let (_store, restored, quarantined, _events) = open(&path);
    assert!(!quarantined.is_empty());
    assert_eq!((restored.active, restored.model_sets.len()), (vec![], 1), "{quarantined:?}");
}

#[test]
fn a_damaged_model_set_goes_with_the_sound_one_of_its_id() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [_, second] = filled(&path);
    std::fs::remove_file(crate::beside::active(&path)).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("DROP TRIGGER model_sets_keep; UPDATE model_sets SET json = x'00' WHERE seq = 2").unwrap();
    drop(other);
    let (store, _, quarantined, _events) = open(&path);
    assert_eq!(quarantined.len(), 2, "{quarantined:?}");
    write(&store, vec![Record::ModelSet(Arc::new(second.clone())), set_deleted(&second.id)]).unwrap();
    store.close().unwrap();
    assert_eq!(Db::open(&path).unwrap().2, []);
}

/// What was deleted by command is told from what is lost, whichever row it is.
#[test]
fn rows_that_are_lost_beside_deleted_ones_are_noticed() {
    for (damage, expected) in [
        ("DELETE FROM deleted_sessions", "the list of deleted sessions"),
        ("DELETE FROM deleted_model_sets", "the list of deleted model sets"),
        ("UPDATE deleted_sessions SET number = 9", "the deletion of session 9"),
        ("UPDATE deleted_model_sets SET activation = 9", "the deletion of the model set in row 1"),
        ("DELETE FROM model_sets WHERE seq = 2", "the list of model sets"),
        ("DELETE FROM sessions WHERE number = 1", "the list of sessions"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        let [first, second] = filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![activated(&second), session_deleted(2), set_deleted(&first.id)]).unwrap();
        write(&store, vec![Record::ModelSet(Arc::new(model_set(3)))]).unwrap();
        store.close().unwrap();
        assert_eq!(Db::open(&path).unwrap().2, []);
        let other = Connection::open(&path).unwrap();
        for statement in
            ["DELETE FROM deleted_sessions", "UPDATE deleted_model_sets SET id = 'x'", "DELETE FROM samples"]
        {
            let harmless = statement == "DELETE FROM samples"; // none are left
            assert_eq!(other.execute(statement, []).is_ok(), harmless, "{statement}");
        }
        for table in ["deleted_sessions", "deleted_model_sets", "model_sets", "sessions"] {
            other.execute_batch(&format!("DROP TRIGGER {table}_stay; DROP TRIGGER IF EXISTS {table}_keep")).unwrap();
        }
        other.execute_batch(damage).unwrap();
        drop(other);
        let (_, restored, quarantined) = Db::open(&path).unwrap();
        assert!(quarantined.iter().any(|finding| finding.what == expected), "{damage}: {quarantined:?}");
        assert!(restored.next_session >= 3, "{damage}: no number is used again");
    }
}

#[test]
fn findings_are_told_in_so_many_lines_and_no_more() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, (1..=30).map(|number| session(number, SessionState::Aborted)).collect()).unwrap();
    store.close().unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("UPDATE sessions SET view = 'x'").unwrap();
    drop(other);
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!((quarantined.len(), restored.problems.len()), (30, 21));
    assert_eq!(restored.problems[0], "session 1 is damaged on disk and not used: its checksum is wrong");
    assert_eq!(restored.problems[20], "10 more rows of the store are damaged and not used; the log names them");
}
