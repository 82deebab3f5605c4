//! What root makes beside the store of another account is that account's: its daemon has to open it.

use std::fs;
use std::os::unix::fs::{MetadataExt, chown};
use std::path::Path;

use rusqlite::Connection;

use super::fixture::*;
use crate::{beside, check, compact};

/// Any but root's.
const OWNER: u32 = 4_000_000;

/// A store of another account; none where this is not root, who alone can make one.
fn of_another(path: &Path) -> bool {
    filled(path);
    let files = [path.to_path_buf(), beside::active(path), beside::lock(path)];
    let given = files.iter().try_for_each(|file| chown(file, Some(OWNER), Some(OWNER)));
    given.inspect_err(|why| eprintln!("SKIPPED: only root gives files to others: {why}")).is_ok()
}

fn owner(path: &Path) -> u32 {
    fs::metadata(path).unwrap().uid()
}

#[test]
fn a_store_that_root_has_open_stays_its_owners() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    if !of_another(&path) {
        return;
    }
    let (store, ..) = open(&path);
    write(&store, vec![activated(&model_set(1))]).unwrap();
    for file in [beside::open_mark(&path), beside::wal(&path), beside::lock(&path), path.clone()] {
        assert_eq!(owner(&file), OWNER, "{}", file.display());
    }
    store.close().unwrap();
    assert_eq!(owner(&beside::active(&path)), OWNER);
}

#[test]
fn a_damaged_store_that_root_puts_right_stays_its_owners() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    if !of_another(&path) {
        return;
    }
    Connection::open(&path).unwrap().execute_batch("PRAGMA wal_checkpoint(TRUNCATE)").unwrap();
    let mut bytes = fs::read(&path).unwrap();
    bytes[4_096..4_696].fill(0x5a);
    fs::write(&path, bytes).unwrap();
    assert!(!check(&path).unwrap().damage.is_empty());
    compact(&path).unwrap();
    assert_eq!(owner(&path), OWNER);
    assert!(dir.path().read_dir().unwrap().any(|entry| entry.unwrap().file_name() == "store.db.damaged-1"));
}
