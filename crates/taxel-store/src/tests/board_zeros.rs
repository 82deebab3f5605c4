//! What is known of the boards' zeros is found again, and what cannot be read is not taken for nothing.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use rusqlite::Connection;
use taxel_engine::Restored;
use taxel_engine::record::{BoardZeros, HiddenCounts, Record};

use super::fixture::*;
use crate::db::Db;

pub const WHY: &str = "board 13 lost its load while it was silent";

pub fn doubt(patch: &str, why: Option<&str>) -> Record {
    record(patch, BoardZeros { unproven: why.map(str::to_owned), ..BoardZeros::default() })
}

/// The patches of which the counts cannot show whether the skin is at rest, and why.
pub fn doubts(restored: &Restored) -> Vec<(String, String)> {
    let zeros = restored.board_zeros.iter();
    zeros.filter_map(|(patch, zeros)| Some((patch.clone(), zeros.unproven.clone()?))).collect()
}

fn record(patch: &str, zeros: BoardZeros) -> Record {
    Record::BoardZeros { patch: patch.to_owned(), zeros, wall_ns: 7 }
}

fn configured_at(counts: &[f32]) -> BoardZeros {
    let hidden = HiddenCounts { counts: counts.to_vec(), reads: counts.iter().map(|counts| 240.0 - counts).collect() };
    BoardZeros { hidden: (!counts.is_empty()).then(|| hidden.into()), ..BoardZeros::default() }
}

/// What a start finds: the doubts, and what is wrong with the store, in words.
fn found(path: &Path) -> (Vec<(String, String)>, String) {
    let (_, restored, quarantined) = Db::open(path).unwrap();
    (doubts(&restored), format!("{quarantined:?}"))
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
    assert_eq!(restored.board_zeros, []);
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
        ("row 2: its checksum is wrong", "UPDATE zero_doubts SET hidden = x'0000C03F' WHERE seq = 2"),
        ("row 2: its checksum is wrong", "UPDATE zero_doubts SET reads = x'' WHERE seq = 2"),
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

/// Where the record of how many rows there were is lost with the rest of a damaged file, or never was, the newest row may be.
#[test]
fn a_store_that_was_put_right_without_that_record_holds_what_may_be_lost_against_the_boards() {
    for (records, damaged, held) in [(1, "samples", false), (1, "tally", true), (0, "samples", true)] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![doubt(PATCH, None); records]).unwrap();
        store.close().unwrap();
        let page = "SELECT pageno FROM dbstat WHERE name = ?1 AND pagetype = 'leaf' LIMIT 1";
        let page: u64 = Connection::open(&path).unwrap().query_row(page, [damaged], |row| row.get(0)).unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        file.write_all_at(&[0xFF; 4096], (page - 1) * 4096).unwrap();
        let (doubts, told) = found(&path);
        assert!(told.contains("rows of it are in a new one"), "{damaged}: {told}");
        assert_eq!(!doubts.is_empty(), held, "{records} records, {damaged}: {doubts:?}");
        assert_eq!(found(&path).0, doubts, "the next start");
    }
}

/// A loss stays where it is, and the file would grow with each start.
#[test]
fn what_follows_from_a_loss_is_written_down_once() {
    for (damages, noted) in [("", 0), ("DELETE FROM zero_doubts WHERE seq = 3", 1)] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![doubt(PATCH, Some(WHY)), doubt(PATCH, None), record(PATCH, configured_at(&[0.5]))]).unwrap();
        store.close().unwrap();
        damage(&path, damages);
        let rows = || -> u64 {
            let count = "SELECT count(*) FROM zero_doubts";
            Connection::open(&path).unwrap().query_row(count, [], |row| row.get(0)).unwrap()
        };
        let before = rows();
        for start in 0..3 {
            let (store, ..) = open(&path);
            store.close().unwrap();
            assert_eq!(rows(), before + noted, "{damages}: start {start}");
        }
    }
}

#[test]
fn what_the_boards_zeros_hide_is_found_again_bit_by_bit_until_they_are_configured_anew() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    let (a, b) = (configured_at(&[-1.5, 0.1, f32::MIN_POSITIVE, -0.0]), configured_at(&[0.25]));
    write(&store, vec![record("a", configured_at(&[2.0])), record("a", a.clone()), record("b", b)]).unwrap();
    write(&store, vec![record("b", configured_at(&[]))]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!((restored.board_zeros, quarantined), (vec![("a".to_owned(), a)], vec![]));
}

/// Whoever vouches for a zero under which something was hidden already does not make that go away.
#[test]
fn what_the_boards_zeros_hide_is_known_beside_what_is_held_against_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    let zeros = configured_at(&[-1.5; 4]);
    write(&store, vec![record(PATCH, zeros.clone()), doubt("b", None)]).unwrap();
    store.close().unwrap();
    damage(&path, "DELETE FROM zero_doubts WHERE seq = 2");
    for start in 0..2 {
        let (_, restored, _) = Db::open(&path).unwrap();
        let [(patch, found)] = &restored.board_zeros[..] else { panic!("{:?}", restored.board_zeros) };
        assert_eq!((patch.as_str(), &found.hidden), (PATCH, &zeros.hidden), "start {start}");
        assert!(found.unproven.as_ref().is_some_and(|why| why.contains("damaged on disk")), "{found:?}");
    }
}
