//! A store that another process has: whoever is refused leaves no trace, whatever it would have put right.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};

use rusqlite::Connection;

use super::audit::{answered, asked, files};
use super::fixture::*;
use super::nothing_lost::killed;
use crate::db::Db;
use crate::lock::StoreLock;
use crate::open_mark::OpenMark;
use crate::{AuditFile, StoreError, StoreFile, beside, check, compact};

const CHILD: &str = "TAXEL_STORE_SQLITE_CHILD";

/// Runs in the child: what an earlier version or another program does to a database. Says what came of it, and ends with its
/// input.
#[test]
fn sqlite_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let other = Connection::open(path).unwrap();
    other.busy_timeout(std::time::Duration::ZERO).unwrap();
    other.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(())).unwrap();
    let looked = other.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()));
    println!("\nlooked: {}", if looked.is_ok() { "held" } else { "refused" });
    std::io::stdin().read_to_end(&mut Vec::new()).unwrap();
}

/// A child with what it says, and what came of its look.
fn sqlite(path: &Path) -> ((Child, BufReader<ChildStdout>), String) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "tests::in_use::sqlite_child", "--nocapture", "--test-threads=1"])
        .env(CHILD, path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap());
    let mut lines = said.by_ref().lines().map(Result::unwrap);
    let looked = lines.find_map(|line| line.strip_prefix("looked: ").map(str::to_owned)).unwrap();
    ((child, said), looked)
}

fn end((mut child, mut said): (Child, BufReader<ChildStdout>)) {
    drop(child.stdin.take());
    said.read_to_end(&mut Vec::new()).unwrap();
    child.wait().unwrap();
}

/// All that opens a store is refused and changes nothing.
fn everybody_is_refused(path: &Path, what: &str) {
    let before = files(path.parent().unwrap());
    let in_use = Some(StoreError::InUse { path: path.to_path_buf() });
    let refusals = [Db::open(path).err(), StoreFile::open(path).err(), check(path).err(), compact(path).err()];
    assert_eq!(refusals, [(); 4].map(|()| in_use.clone()), "{what}");
    assert!(files(path.parent().unwrap()) == before, "{what}: something was changed");
}

type Damage = fn(&Path);

#[test]
fn a_start_that_is_refused_leaves_all_as_it_is() {
    let damages: [(&str, Damage); 5] = [
        ("nothing", |_| {}),
        ("no log", |path| fs::remove_file(beside::wal(path)).unwrap()),
        ("a log that was cut off", |path| fs::write(beside::wal(path), []).unwrap()),
        ("a database that is none", |path| fs::write(path, [7; 9000]).unwrap()),
        ("a new one", |path| fs::write(beside::successor(path), []).unwrap()),
    ];
    for (what, damage) in damages {
        let (_dir, path) = killed();
        damage(&path);
        let _lock = StoreLock::take(&path).unwrap();
        everybody_is_refused(&path, what);
    }
}

/// An earlier version has SQLite's lock alone. What its mark says and what is in its log is not read at one moment.
#[test]
fn a_start_beside_an_earlier_version_leaves_all_as_it_is() {
    let (_dir, path) = killed();
    drop(StoreLock::take(&path).unwrap()); // its file is there
    let (child, looked) = sqlite(&path);
    assert_eq!(looked, "held");
    OpenMark::set(&path).unwrap().note(u32::MAX);
    everybody_is_refused(&path, "an earlier version");
    end(child);
}

#[test]
fn an_earlier_version_is_refused_beside_a_store_that_was_just_made() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    let (child, looked) = sqlite(&path);
    assert_eq!(looked, "refused");
    end(child);
    store.close().unwrap();
}

#[test]
fn where_a_new_store_can_have_no_lock_the_reason_names_it() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    fs::create_dir(beside::lock(&path)).unwrap();
    let said = Db::open(&path).err().unwrap().to_string();
    assert!(said.contains("store.db-lock: is no regular file"), "{said}");
}

/// Entries that are sound are those that were written, whoever has the store by now.
#[test]
fn an_audit_log_that_looks_damaged_while_a_daemon_has_the_store_is_not_called_so() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![asked(1), answered(1)]).unwrap();
    store.close().unwrap();
    let read = || AuditFile::open(&path).unwrap();
    let lock = |file: &AuditFile| (StoreLock::take(&path).unwrap(), file.before(u64::MAX, 10)).1;
    assert_eq!(lock(&read()).unwrap().len(), 1);
    let change = "DROP TRIGGER audit_keep; UPDATE audit SET entry = 'another'";
    Connection::open(&path).unwrap().execute_batch(change).unwrap();
    let file = read();
    assert_eq!(lock(&file).unwrap_err(), StoreError::InUse { path: path.clone() });
    assert!(!file.before(u64::MAX, 10).unwrap()[0].damage.is_empty());
}
