//! Files of a store from two moments: a store that was copied while it was open, or a database that was put back beside the
//! log that lay there.

use std::fs;
use std::path::{Path, PathBuf};

use rusqlite::Connection;
use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;
use tempfile::TempDir;

use super::board_zeros::{WHY, doubt, doubts};
use super::disk::folder;
use super::fixture::*;
use super::lost::copy;
use super::nothing_lost::killed;
use crate::db::Db;
use crate::retention::Retention;
use crate::{beside, check};

/// A store as a kill has left it, and as it was closed after more was written.
fn moments() -> [(TempDir, PathBuf); 2] {
    let (old, path) = killed();
    let new = folder();
    copy(old.path(), new.path());
    let later = new.path().join("store.db");
    let (store, ..) = open(&later);
    let another = model_set(3);
    write(&store, vec![began(2, 1, vec![model_set(0).baseline[0]; 3_000])]).unwrap();
    write(&store, vec![Record::ModelSet(another.clone().into()), activated(&another)]).unwrap();
    write(&store, vec![doubt(PATCH, Some(WHY))]).unwrap();
    store.close().unwrap();
    [(old, path), (new, later)]
}

/// The files of this database beside other ones.
fn mixed(database: &Path, others: &Path, suffixes: &[&str]) -> (TempDir, PathBuf) {
    let folder = folder();
    let path = folder.path().join("store.db");
    fs::copy(database, &path).unwrap();
    for suffix in suffixes {
        let from = beside::beside(others, suffix);
        if from.exists() {
            fs::copy(from, beside::beside(&path, suffix)).unwrap();
        }
    }
    (folder, path)
}

#[test]
fn a_doubt_of_the_boards_zeros_outlives_a_log_of_before() {
    let [(_old, old), (_new, new)] = moments();
    for suffixes in [&["-wal"][..], &["-wal", "-open"], &["-wal", "-active"], &["-wal", "-open", "-active"]] {
        let (_folder, path) = mixed(&new, &old, suffixes);
        let (_, restored, quarantined) = Db::open(&path).unwrap();
        assert_eq!(doubts(&restored).len(), 1, "{suffixes:?}: {quarantined:?}");
    }
}

#[test]
fn a_database_of_before_beside_the_log_of_after_is_put_right() {
    // Of the larger one it lacks more than SQLite lets pass.
    for taxels in [3_000, 25_000] {
        let (before, after) = (folder(), folder());
        let old = before.path().join("store.db");
        filled(&old);
        copy(before.path(), after.path());
        let new = after.path().join("store.db");
        let another = model_set(3);
        let (store, ..) = open(&new);
        write(&store, vec![began(2, 1, vec![model_set(0).baseline[0]; taxels])]).unwrap();
        write(&store, vec![Record::ModelSet(another.clone().into()), activated(&another)]).unwrap();
        store.close().unwrap();
        let (store, ..) = open(&new);
        write(&store, vec![doubt(PATCH, None), session(3, SessionState::Aborted)]).unwrap();
        let mixes = [&["-wal", "-open"][..], &["-wal", "-open", "-active"]];
        // Small stores are proven whole at a start, and large ones are not.
        for (suffixes, whole_bytes_max) in mixes.into_iter().flat_map(|mix| [(mix, u64::MAX), (mix, 0)]) {
            let (_folder, path) = mixed(&old, &new, suffixes);
            let found = check(&path).unwrap().damage;
            let (db, restored, quarantined) = Db::open_proving(&path, &Retention::default(), whole_bytes_max).unwrap();
            for told in [&found, &quarantined] {
                let first = &told[0];
                assert!(first.what == "the store" && first.reason.contains("its log is that of one with"), "{first:?}");
            }
            assert_eq!(doubts(&restored).len(), 1, "{suffixes:?}: {quarantined:?}");
            db.writable().unwrap().close().unwrap();
            let (db, again, _) = Db::open(&path).unwrap();
            assert_eq!(doubts(&again), doubts(&restored));
            db.writable().unwrap().close().unwrap();
        }
        store.close().unwrap();
    }
}

/// Rows that are missing elsewhere stay so, and are held against the boards until somebody has vouched for the zero once.
#[test]
fn what_is_missing_elsewhere_is_held_against_the_boards_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, None)]).unwrap();
    store.close().unwrap();
    let change = "DROP TRIGGER activations_stay; DELETE FROM activations WHERE seq = 1";
    Connection::open(&path).unwrap().execute_batch(change).unwrap();
    for _ in 0..2 {
        let (_, restored, quarantined) = Db::open(&path).unwrap();
        let [(_, why)] = &doubts(&restored)[..] else { panic!("{quarantined:?}") };
        assert!(why.ends_with("as more of the store is not what was written: activation 1"), "{why}");
    }
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, None)]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(doubts(&restored), [], "it was vouched for since");
    assert_eq!(quarantined.len(), 1, "what is missing goes on being told: {quarantined:?}");
}
