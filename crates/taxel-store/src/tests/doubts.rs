//! What is held against the boards' zeros is found again, and what cannot be read is not taken for nothing.

use rusqlite::Connection;
use std::path::Path;
use taxel_engine::record::Record;

use super::fixture::*;
use crate::db::Db;

pub const WHY: &str = "board 13 lost its load while it was silent";

pub fn doubt(patch: &str, why: Option<&str>) -> Record {
    Record::ZeroDoubt { patch: patch.to_owned(), why: why.map(str::to_owned), wall_ns: 7 }
}

/// What a start finds: the doubts, and what is wrong with the store, in words.
fn found(path: &Path) -> (Vec<(String, String)>, String) {
    let (_, restored, quarantined) = Db::open(path).unwrap();
    (restored.doubts, format!("{quarantined:?}"))
}

fn damage(path: &Path, statements: &str) {
    let drops = "DROP TRIGGER zero_doubts_keep; DROP TRIGGER zero_doubts_stay;";
    Connection::open(path).unwrap().execute_batch(&format!("{drops} {statements}")).unwrap();
}

#[test]
fn the_newest_of_a_patch_counts() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, restored, ..) = open(&path);
    assert_eq!(restored.doubts, []);
    write(&store, vec![doubt("a", Some("once")), doubt("b", Some(WHY)), doubt("a", None)]).unwrap();
    write(&store, vec![doubt("c", Some("once")), doubt("c", Some(WHY))]).unwrap();
    store.close().unwrap();
    let held = [("b".to_owned(), WHY.to_owned()), ("c".to_owned(), WHY.to_owned())];
    assert_eq!(found(&path), (held.to_vec(), "[]".to_owned()));
    let other = Connection::open(&path).unwrap();
    for statement in ["DELETE FROM zero_doubts", "UPDATE zero_doubts SET why = ''"] {
        let refused = other.execute(statement, []).unwrap_err().to_string();
        assert!(refused.contains("append-only"), "{statement}: {refused}");
    }
}

/// Each way to lose a row leaves the patch doubted until somebody vouches for its zero.
#[test]
fn what_cannot_be_read_is_held_against_the_boards() {
    for (what, statements) in [
        ("row 2: its checksum is wrong", "UPDATE zero_doubts SET why = '' WHERE seq = 2"),
        ("row 2: its checksum is wrong", "UPDATE zero_doubts SET patch = 'b' WHERE seq = 2"),
        ("row 1 is missing", "DELETE FROM zero_doubts WHERE seq = 1"),
        ("2 rows were written, the last ones are missing", "DELETE FROM zero_doubts WHERE seq = 2"),
        ("the last ones are missing", "DELETE FROM zero_doubts"),
        ("the record of how many", "UPDATE tally SET rows = 0 WHERE stream = 'zero doubts'"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![doubt(PATCH, None), doubt(PATCH, Some(WHY))]).unwrap();
        store.close().unwrap();
        damage(&path, statements);
        let (doubts, told) = found(&path);
        assert_eq!(doubts.len(), 1, "{statements}: {doubts:?}");
        assert_eq!(doubts[0].0, PATCH, "{statements}");
        assert!(told.contains(what), "{statements}: {told}");
        let (store, ..) = open(&path);
        write(&store, vec![doubt(PATCH, None)]).unwrap();
        store.close().unwrap();
        assert_eq!(found(&path).0, [], "{statements}: it was vouched for since");
    }
}
