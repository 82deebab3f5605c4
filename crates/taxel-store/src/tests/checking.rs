//! A check tells what the next start would, and changes nothing.

use std::fs;
use std::path::Path;

use rusqlite::Connection;
use taxel_engine::calibration::SessionState;

use super::audit::files;
use super::disk::{folder, shim, told};
use super::fixture::*;
use super::nothing_lost::killed;
use super::older::written_by;
use crate::db::Db;
use crate::lock::StoreLock;
use crate::{AuditFile, Quarantined, StoreError, StoreFile, beside, check, loss, schema};

const CHILD: &str = "TAXEL_STORE_CHECKING_CHILD";

type Damage = fn(&Path);

#[test]
fn a_check_tells_what_the_next_start_does_and_changes_nothing() {
    let damages: [(&str, Damage); 7] = [
        ("nothing", |_| {}),
        ("no log", |path| fs::remove_file(beside::wal(path)).unwrap()),
        ("a log that was cut off", |path| fs::write(beside::wal(path), []).unwrap()),
        ("a note", |path| loss::note(path, &Quarantined::lost("the store", "it is an old one")).unwrap()),
        ("a note of the log, and the log", |path| {
            fs::write(beside::wal(path), []).unwrap();
            loss::note(path, &Quarantined::lost(loss::LOG, "it is missing")).unwrap();
        }),
        ("a plain file that is none", |path| fs::write(beside::active(path), "junk").unwrap()),
        ("a database older than its plain file", |path| {
            let newer = tempfile::tempdir().unwrap();
            let other = newer.path().join("store.db");
            let [first, _] = filled(&other);
            let (store, ..) = open(&other);
            write(&store, vec![activated(&first)]).unwrap();
            store.close().unwrap();
            fs::copy(beside::active(&other), beside::active(path)).unwrap();
        }),
    ];
    for (what, damage) in damages {
        let (dir, path) = killed();
        damage(&path);
        fs::write(beside::beside(&path, "-check"), "somebody's own").unwrap();
        let before = files(dir.path());
        let named = |damage: &[Quarantined]| damage.iter().map(|found| found.what.clone()).collect::<Vec<_>>();
        let found = named(&check(&path).unwrap().damage);
        assert!(files(dir.path()) == before, "{what}: something was changed");
        let read = StoreFile::open(&path).unwrap();
        assert_eq!(named(read.damage()), found, "{what}");
        drop(read);
        let (db, _, told) = Db::open(&path).unwrap();
        db.close().unwrap();
        assert_eq!(named(&told), found, "{what}");
        assert_eq!(found.is_empty(), what == "nothing", "{what}");
    }
}

/// A start leaves them to whoever reads them.
#[test]
fn a_check_proves_the_samples_of_ended_sessions() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![session(1, SessionState::Discarded), ramp(1, 0), sample_record(1, 0)]).unwrap();
    store.close().unwrap();
    let change = "DROP TRIGGER samples_keep; UPDATE samples SET pressure_kpa = 7";
    Connection::open(&path).unwrap().execute_batch(change).unwrap();
    assert_eq!(StoreFile::open(&path).unwrap().damage(), []);
    let damage = check(&path).unwrap().damage;
    assert!(damage.len() == 1 && damage[0].what == "samples of session 1", "{damage:?}");
}

/// Runs in the child: says what a check came to.
#[test]
fn checking_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    match check(Path::new(&path)) {
        Ok(found) => println!("\nchecked: {} samples, {} findings", found.samples, found.damage.len()),
        Err(error) => println!("\nrefused: {error}"),
    }
}

#[test]
fn a_check_takes_nothing_of_the_disk_with_the_store_also_of_an_earlier_version() {
    let tools = folder();
    let shim = shim(&tools);
    let older = folder();
    let path = older.path().join("store.db");
    written_by(schema::STEPS.len() - 1, &path);
    for (_dir, path) in [killed(), (older, path)] {
        let test = "tests::checking::checking_child";
        let lines = told(&shim, test, CHILD, &path, &[("FAULT", "readonly")]);
        assert!(lines.iter().any(|line| line.starts_with("checked: ") && line.ends_with(", 0 findings")), "{lines:?}");
    }
}

/// A daemon that starts changes the files under whoever reads them.
#[test]
fn what_looks_damaged_while_a_daemon_has_the_store_is_not_called_so() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let changing_nothing = Some(StoreError::TooOld { path: path.clone() });
    let read = || StoreFile::read(&path, &path, changing_nothing.clone(), &mut Vec::new());
    let in_use = StoreError::InUse { path: path.clone() };
    let (sound, lock) = (read().unwrap(), StoreLock::take(&path).unwrap());
    assert!(read().is_ok() && sound.prove_all().is_ok(), "what is sound is what was written");
    drop(lock);
    let change = |change: &str| Connection::open(&path).unwrap().execute_batch(change).unwrap();
    change("DROP TRIGGER samples_keep; UPDATE samples SET pressure_kpa = 7");
    let [file, proven] = [read().unwrap(), read().unwrap()];
    let lock = StoreLock::take(&path).unwrap();
    assert_eq!(file.samples(2).unwrap_err(), in_use);
    assert_eq!(proven.prove_all().unwrap_err(), in_use);
    drop(lock);
    assert!(matches!(file.samples(2).unwrap_err(), StoreError::DamagedSamples { .. }));
    change("UPDATE sessions SET view = 'another'");
    assert!(!read().unwrap().damage().is_empty());
    let _lock = StoreLock::take(&path).unwrap();
    assert_eq!(read().err(), Some(in_use));
}

#[test]
fn whoever_reads_the_audit_log_of_a_store_is_told_what_that_has_lost() {
    let (_dir, path) = killed();
    assert_eq!(AuditFile::open(&path).unwrap().lost(), []);
    fs::remove_file(beside::wal(&path)).unwrap();
    let lost = AuditFile::open(&path).unwrap().lost().to_vec();
    assert!(lost.len() == 1 && lost[0].to_string().starts_with("the write-ahead log: it is missing"), "{lost:?}");
}
