//! The audit log on disk: pages, results, damage, and that nothing is ever taken out.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;

use rusqlite::Connection;
use taxel_engine::audit::{Answered, Asked, AuditEntry};
use taxel_engine::record::Record;

use super::fixture::*;
use crate::{AuditFile, Store, StoreError};

pub fn asked(request: u64) -> Record {
    Record::Asked(Box::new(Asked {
        request,
        wall_ns: request as i64,
        who: format!("who {request}"),
        method: "Tare".to_owned(),
        before: "m-1".to_owned(),
        ..Asked::default()
    }))
}

pub fn answered(request: u64) -> Record {
    let result = format!("done {request}");
    Record::Answered(Box::new(Answered { request, wall_ns: request as i64, result, after: "m-2".to_owned() }))
}

pub fn entries(store: &Store, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
    let (tell, told) = channel();
    store.audit_reader().read(before, most, Box::new(move |entries| tell.send(entries).unwrap()));
    told.recv().unwrap()
}

fn filled_log(path: &Path) {
    let (store, ..) = open(path);
    for request in 1..=10 {
        write(&store, vec![asked(request)]).unwrap();
        if request != 7 {
            write(&store, vec![answered(request)]).unwrap();
        }
    }
    store.close().unwrap();
}

#[test]
fn entries_come_back_with_their_results_newest_first_and_numbers_go_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled_log(&path);
    let (store, _, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    // A new run numbers its requests anew.
    write(&store, vec![asked(1), answered(1)]).unwrap();
    let all = entries(&store, u64::MAX, 100).unwrap();
    let numbers: Vec<u64> = all.iter().map(|entry| entry.number).collect();
    assert_eq!(numbers, (1..=11).rev().collect::<Vec<_>>());
    for entry in &all {
        let request = if entry.number == 11 { 1 } else { entry.number };
        assert_eq!(entry.asked.as_ref().unwrap().who, format!("who {request}"));
        let result = entry.answered.as_ref().map(|answered| answered.result.clone());
        assert_eq!(result, (entry.number != 7).then(|| format!("done {request}")), "entry {}", entry.number);
    }
    let page = entries(&store, 5, 2).unwrap();
    assert_eq!(page.iter().map(|entry| entry.number).collect::<Vec<_>>(), [4, 3]);
    let second = write(&store, vec![answered(1)]).unwrap_err();
    assert!(matches!(second, StoreError::Unstorable { .. }), "a result is written once: {second}");
}

#[test]
fn nothing_is_taken_out_or_changed_by_other_programmes_either() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled_log(&path);
    let connection = Connection::open(&path).unwrap();
    for table in ["audit", "audit_results"] {
        for statement in [format!("DELETE FROM {table}"), format!("UPDATE {table} SET entry = ''")] {
            let error = connection.execute(&statement, []).unwrap_err().to_string();
            assert!(error.contains("append-only"), "{statement}: {error}");
        }
    }
}

#[test]
fn what_was_changed_or_taken_out_by_force_is_told_and_never_shown_as_true() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled_log(&path);
    let connection = Connection::open(&path).unwrap();
    let changes = "DROP TRIGGER audit_stay; DROP TRIGGER audit_keep; DROP TRIGGER audit_results_keep;
        DROP TRIGGER audit_results_stay;
        UPDATE audit SET entry = replace(entry, 'who 3', 'who 4') WHERE seq = 3;
        UPDATE audit_results SET entry = replace(entry, 'done 5', 'done 6') WHERE seq = 5;
        DELETE FROM audit_results WHERE seq = 10; DELETE FROM audit WHERE seq = 10;";
    connection.execute_batch(changes).unwrap();
    drop(connection);
    let (store, restored, quarantined, _events) = open(&path);
    let told: Vec<String> = quarantined.iter().map(ToString::to_string).collect();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].contains("the audit log (audit)") && told[0].contains("10 were written, 9 are there"), "{told:?}");
    assert_eq!(restored.problems, told, "the health names it");
    let all = entries(&store, u64::MAX, 100).unwrap();
    let entry = |number| all.iter().find(|entry| entry.number == number).unwrap();
    assert_eq!((entry(3).asked.as_ref(), entry(3).damage.as_str()), (None, "the request: its checksum is wrong"));
    assert_eq!((entry(5).answered.as_ref(), entry(5).damage.as_str()), (None, "the result: its checksum is wrong"));
    assert!(entry(4).damage.is_empty() && entry(4).asked.is_some());
}

/// Every file beside the store, with what is in it.
pub fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| (path.clone(), fs::read(path).unwrap())).collect()
}

/// The next start has to find what was lost, and tell it.
#[test]
fn the_log_of_a_store_that_nobody_has_open_is_read_and_nothing_is_changed() {
    let (work, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = work.path().join("store.db");
    filled_log(&path);
    let (store, ..) = open(&path);
    write(&store, vec![asked(11)]).unwrap();
    let error = AuditFile::open(&path).unwrap_err();
    assert!(matches!(error, StoreError::InUse { .. }), "{error}");
    super::lost::copy(work.path(), killed.path());
    let path = killed.path().join("store.db");
    let damaged = |page: usize| {
        let mut bytes = fs::read(&path).unwrap();
        bytes[page * 4096..][..4096].fill(0xFF);
        fs::write(&path, bytes).unwrap();
    };
    let before = files(killed.path());
    assert!(before.len() > 2, "as a kill leaves it: {:?}", before.keys());
    let read = AuditFile::open(&path).unwrap().before(u64::MAX, 100).unwrap();
    assert_eq!(read.iter().map(|entry| entry.number).collect::<Vec<_>>(), (1..=11).rev().collect::<Vec<_>>());
    assert_eq!(files(killed.path()), before);
    damaged(0);
    let before = files(killed.path());
    let error = AuditFile::open(&path).and_then(|log| log.before(u64::MAX, 100)).unwrap_err();
    assert_eq!(files(killed.path()), before, "{error}");
}

#[test]
fn what_is_no_store_has_no_log_and_stays_as_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("empty");
    assert!(matches!(AuditFile::open(&path).unwrap_err(), StoreError::Open { .. }));
    assert!(files(dir.path()).is_empty());
    fs::write(&path, b"").unwrap();
    let error = AuditFile::open(&path).unwrap_err();
    assert!(error.to_string().contains("it has no audit log"), "{error}");
    assert_eq!(files(dir.path()), [(path, Vec::new())].into());
}
