//! Where nothing was lost no loss is told: one that is told has every zero doubted.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::board_zeros::doubts;
use super::disk::{folder, shim, told};
use super::fixture::*;
use super::lost::copy;
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
        nothing_is_told(&path, &format!("{fault} at call {call} of {calls}"));
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
    fs::copy(&path, beside::successor(&path)).unwrap();
    succeed(&path).unwrap();
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
