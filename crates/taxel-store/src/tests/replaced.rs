//! A file of the store is removed or replaced under the running programme.

use std::fs;
use std::path::Path;

use taxel_engine::calibration::SessionState;

use super::fixture::*;
use crate::{StoreError, StoreEvent, beside};

type Removal = fn(&Path);

#[test]
fn what_is_written_into_a_file_that_is_gone_is_not_called_stored() {
    let gone: [(&str, Removal); 4] = [
        ("the database", |path| fs::remove_file(path).unwrap()),
        ("the log", |path| fs::remove_file(beside::wal(path)).unwrap()),
        ("another database", |path| {
            let other = beside::beside(path, "-other");
            fs::copy(path, &other).unwrap();
            fs::rename(other, path).unwrap();
        }),
        ("the folder", |path| {
            let folder = path.parent().unwrap();
            fs::rename(folder, folder.with_extension("moved")).unwrap();
        }),
    ];
    for (what, remove) in gone {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("store")).unwrap();
        let path = dir.path().join("store/store.db");
        let (store, _, _, events) = open(&path);
        write(&store, vec![session(1, SessionState::Ramping)]).unwrap();
        remove(&path);
        let refused = write(&store, vec![session(1, SessionState::Aborted)]).unwrap_err();
        assert!(matches!(refused, StoreError::Replaced { .. }), "{what}: {refused}");
        assert!(refused.to_string().contains("removed or replaced"), "{refused}");
        let later = write(&store, vec![session(1, SessionState::Aborted)]).unwrap_err();
        assert_eq!(later, StoreError::ReadOnly { reason: refused.to_string() }, "{what}");
        assert_eq!(store.close(), Err(refused.clone()), "{what}");
        let failures: Vec<_> = events.iter().filter(|event| matches!(event, StoreEvent::Failed(_))).collect();
        assert_eq!(failures, [StoreEvent::Failed(refused.to_string())], "{what}");
    }
}

/// The store folds its log back and shortens it without that its files become others.
#[test]
fn a_store_that_only_grows_and_shrinks_is_not_taken_for_another() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![session(1, SessionState::Taring)]).unwrap();
    let rest = model_set(0).baseline[0];
    for ramp in 0..24 {
        write(&store, vec![began(1, ramp, vec![rest; 25_000])]).unwrap();
    }
    write(&store, vec![session(2, SessionState::Aborted)]).unwrap();
    write(&store, vec![taxel_engine::record::Record::SessionDeleted { session: 2, wall_ns: 1 }]).unwrap();
    write(&store, vec![session(3, SessionState::Aborted)]).unwrap();
    store.close().unwrap();
}

#[test]
fn a_store_that_is_removed_after_its_last_write_is_told_when_it_is_closed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![session(1, SessionState::Aborted)]).unwrap();
    fs::remove_file(&path).unwrap();
    assert!(matches!(store.close(), Err(StoreError::Replaced { .. })));
}

/// Of the same file so much is left. Nothing is stored any more, and what is left is not folded back.
#[test]
fn a_log_that_is_cut_off_while_it_is_open_takes_nothing_more_and_leaves_the_database_as_it_is() {
    for (kept, writes) in [(0, true), (0, false), (32, true), (9000, true), (9000, false)] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        for index in 40..60 {
            write(&store, vec![sample_record(2, index)]).unwrap();
        }
        let database = fs::read(&path).unwrap();
        fs::File::options().write(true).open(beside::wal(&path)).unwrap().set_len(kept).unwrap();
        let what = format!("{kept} bytes are left, written: {writes}");
        if writes {
            let refused = write(&store, vec![sample_record(2, 60)]).unwrap_err();
            assert!(matches!(refused, StoreError::CutOff { bytes, .. } if bytes == kept), "{what}: {refused}");
        }
        assert!(matches!(store.close(), Err(StoreError::CutOff { .. })), "{what}");
        assert!(fs::read(&path).unwrap() == database, "{what}: the database was changed");
        let (store, _, quarantined, _events) = open(&path);
        assert!(quarantined.len() == 1 && quarantined[0].to_string().contains("log"), "{what}: {quarantined:?}");
        assert!(samples_of(&store, 2).unwrap().samples.len() >= 40, "{what}");
        store.close().unwrap();
    }
}
