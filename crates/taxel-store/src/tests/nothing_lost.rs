//! Where nothing was lost no loss is told: one that is told has every zero doubted.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use rusqlite::Connection;
use tempfile::TempDir;

use super::board_zeros::doubts;
use super::disk::{folder, shim, told};
use super::fixture::*;
use super::lost::{OPENING, copy};
use crate::db::Db;
use crate::salvage::succeed;
use crate::{Retention, StoreFile, beside, check, compact, wal_check};

const COMPACTING: [&str; 2] = ["tests::nothing_lost::compacting_child", "TAXEL_STORE_COMPACTING_CHILD"];

/// A store as a kill leaves it, with transactions in the log alone.
pub fn killed() -> (TempDir, PathBuf) {
    let (work, killed) = (folder(), folder());
    let path = work.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    for index in 40..43 {
        write(&store, vec![sample_record(2, index)]).unwrap();
    }
    copy(work.path(), killed.path());
    let path = killed.path().join("store.db");
    (killed, path)
}

/// The next start has nothing to tell and holds nothing against the boards.
fn nothing_is_told(path: &Path, what: &str) {
    let (db, restored, quarantined) = Db::open(path).unwrap();
    db.close().unwrap();
    assert_eq!((quarantined, doubts(&restored).len()), (vec![], 0), "{what}");
}

#[test]
fn compacting_child() {
    let Ok(path) = std::env::var(COMPACTING[1]) else { return };
    println!("compacted: {}", compact(Path::new(&path)).is_ok());
}

#[test]
fn a_compacting_that_fails_at_any_call_loses_nothing() {
    let (tools, [test, variable]) = (folder(), COMPACTING);
    let (shim, count) = (shim(&tools), tools.path().join("calls"));
    let compacts = |path: &Path, fault: &[(&str, &str)]| {
        told(&shim, test, variable, path, fault).iter().any(|line| line.ends_with("compacted: true"))
    };
    let (_dir, path) = killed();
    assert!(compacts(&path, &[("FAULT_COUNT", count.to_str().unwrap())]));
    let calls: u64 = fs::read_to_string(&count).unwrap().trim().parse().unwrap();
    let mut refused = 0;
    for call in 1..=calls {
        let (_dir, path) = killed();
        let fault = ["eio", "enospc"][call as usize % 2];
        refused += u64::from(!compacts(&path, &[("FAULT", fault), ("FAULT_AT", &call.to_string())]));
        let what = format!("{fault} at call {call} of {calls}");
        nothing_is_told(&path, &what);
        let (db, ..) = Db::open(&path).unwrap();
        assert_eq!(db.samples(2).unwrap().samples.len(), 43, "{what}");
        db.close().unwrap();
    }
    assert!(refused > calls / 2, "{refused} of {calls}");
}

/// SQLite has the log beside the file that a link names, and not beside the link.
#[test]
fn a_store_under_the_name_of_a_link_has_its_log_and_its_mark() {
    type Opens = fn(&Path);
    let opens: [(&str, Opens); 3] = [
        ("read", |link| assert_eq!(StoreFile::open(link).unwrap().samples(2).unwrap().samples.len(), 43)),
        ("start", |link| nothing_is_told(link, "start")),
        ("compact", |link| assert_eq!(compact(link).unwrap().damage, [])),
    ];
    for (what, opens) in opens {
        let (dir, path) = killed();
        let link = dir.path().join("link.db");
        symlink(&path, &link).unwrap();
        opens(&link);
        nothing_is_told(&path, what);
        assert!(!beside::open_mark(&link).exists() && !beside::active(&link).exists(), "{what}");
    }
    let (dir, path) = killed();
    let link = dir.path().join("link.db");
    symlink(&path, &link).unwrap();
    fs::write(beside::wal(&path), []).unwrap();
    assert_eq!((StoreFile::open(&link).unwrap().damage().len(), check(&link).unwrap().damage.len()), (1, 1));
}

#[test]
fn the_log_of_a_damaged_store_that_was_salvaged_is_not_missed() {
    let (_dir, path) = killed();
    fs::hard_link(&path, beside::beside(&path, ".damaged-1")).unwrap();
    fs::copy(&path, beside::successor(&path)).unwrap();
    assert_eq!(succeed(&path).unwrap(), None);
    assert!(!beside::wal(&path).exists());
    assert_eq!(wal_check::problem(&path).unwrap(), None);
}

/// A start that ends before anything was written, and one that is given up.
#[test]
fn a_store_that_is_dropped_keeps_its_log() {
    let (_dir, path) = killed();
    drop(Db::open_keeping(&path, &Retention::default()).unwrap());
    assert!(beside::wal(&path).exists());
    nothing_is_told(&path, "dropped");
}

/// Lays something beside this store, under this name.
type Lays<'a> = dyn Fn(&Path, &Path) + 'a;

/// Whoever lays a file there, for example a copy before an upgrade, has the store as it is, and the file under another name.
#[test]
fn what_has_the_name_of_a_new_store_and_did_not_come_of_this_one_replaces_none() {
    let older = |_: &Path, new: &Path| drop(filled(new));
    let copied = |path: &Path, new: &Path| assert!(fs::copy(path, new).unwrap() > 0);
    let foreign = |_: &Path, new: &Path| {
        Connection::open(new).unwrap().execute_batch("CREATE TABLE a (b)").unwrap();
    };
    let make = |make: &str, new: &Path| assert!(Command::new(make).arg(new).status().unwrap().success());
    let pipe = |_: &Path, new: &Path| make("mkfifo", new);
    let folder = |_: &Path, new: &Path| make("mkdir", new);
    let empty = |_: &Path, new: &Path| fs::write(new, []).unwrap();
    let lays: [(&str, &Lays<'_>); 6] = [
        ("an older store", &older),
        ("a copy", &copied),
        ("another program's", &foreign),
        ("a pipe", &pipe),
        ("a folder", &folder),
        ("an empty file", &empty),
    ];
    for (what, lay) in lays {
        let (_dir, path) = killed();
        lay(&path, &beside::successor(&path));
        let (db, restored, quarantined) = Db::open(&path).unwrap();
        assert_eq!(db.samples(2).unwrap().samples.len(), 43, "{what}");
        assert_eq!(doubts(&restored), [], "{what}");
        let told: Vec<_> = quarantined.iter().map(ToString::to_string).collect();
        assert!(told.len() == 1 && told[0].contains("store.db.damaged-1-new"), "{what}: {told:?}");
        db.close().unwrap();
        assert!(beside::beside(&path, ".damaged-1-new").symlink_metadata().is_ok(), "{what}: it is kept");
        nothing_is_told(&path, what);
    }
    // One that is under way takes none of these, either.
    for (what, lay) in [lays[2], lays[3], lays[5]] {
        let (_dir, path) = killed();
        fs::hard_link(&path, beside::beside(&path, ".damaged-1")).unwrap();
        lay(&path, &beside::successor(&path));
        assert!(succeed(&path).unwrap().is_some(), "{what}");
        nothing_is_told(&path, what);
    }
}

/// What is in the log alone is taken over as well, wherever the start that does it is killed.
#[test]
fn a_start_that_puts_a_damaged_store_right_loses_nothing_wherever_it_is_killed() {
    let tools = folder();
    let (shim, count) = (shim(&tools), tools.path().join("calls"));
    let [test, variable] = OPENING;
    let damaged = || {
        let (dir, path) = killed();
        let mut bytes = fs::read(&path).unwrap();
        bytes[20] ^= 0x55; // within the header
        fs::write(&path, bytes).unwrap();
        (dir, path)
    };
    let (_dir, path) = damaged();
    let lines = told(&shim, test, variable, &path, &[("FAULT_COUNT", count.to_str().unwrap())]);
    assert!(lines.iter().any(|line| line == "opened"), "{lines:?}");
    let calls: u64 = fs::read_to_string(&count).unwrap().trim().parse().unwrap();
    for call in 1..=calls {
        let (_dir, path) = damaged();
        told(&shim, test, variable, &path, &[("FAULT", "kill"), ("FAULT_AT", &call.to_string())]);
        let (db, ..) = Db::open(&path).unwrap();
        let samples = db.samples(2).unwrap().samples.len();
        db.close().unwrap();
        assert_eq!(samples, 43, "killed at call {call} of {calls}");
        assert!(!beside::successor(&path).exists(), "killed at call {call} of {calls}");
    }
}
