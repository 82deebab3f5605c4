//! What is held against the boards' zeros may be lost with the log or with the database. Then every zero is doubted until
//! somebody vouches for it: boards keep their zeros while the daemon is away, and one that was taken under a load reads
//! as no force.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use tempfile::TempDir;

use super::board_zeros::{WHY, doubt, doubts};
use super::disk::{folder, shim, told};
use super::fixture::*;
use crate::beside;
use crate::db::Db;

type Damage = fn(&Path);

pub const OPENING: [&str; 2] = ["tests::disk::opening_child", "TAXEL_STORE_HOLDING_CHILD"];

/// A store as a kill leaves it: the zero of its patch was vouched for long ago, and what was found against it since is in
/// the log alone, before two more transactions.
fn killed() -> (TempDir, PathBuf) {
    let (work, killed) = (folder(), folder());
    let path = work.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, Some("once")), doubt(PATCH, None)]).unwrap();
    store.close().unwrap();
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, Some(WHY))]).unwrap();
    write(&store, vec![sample_record(2, 40)]).unwrap();
    write(&store, vec![sample_record(2, 41)]).unwrap();
    copy(work.path(), killed.path());
    let path = killed.path().join("store.db");
    (killed, path)
}

pub fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// The doubted patches of a start that closes the store again, and how much is told.
fn start(path: &Path) -> (Vec<String>, usize) {
    let (db, restored, quarantined) = Db::open(path).unwrap();
    db.close().unwrap();
    (doubts(&restored).into_iter().map(|(patch, _)| patch).collect(), quarantined.len())
}

/// The patch is doubted now and later, until somebody vouches for its zero.
fn is_doubted_until_vouched_for(path: &Path, what: &str) {
    let (doubted, told) = start(path);
    assert_eq!(doubted, [PATCH], "{what}");
    assert!(told > 0, "{what}: the loss is not told");
    assert!(!beside::loss_note(path).exists(), "{what}");
    assert_eq!(start(path).0, [PATCH], "{what}, the second start");
    let (store, ..) = open(path);
    write(&store, vec![doubt(PATCH, None)]).unwrap();
    store.close().unwrap();
    assert_eq!(start(path).0, [""; 0], "{what}: somebody vouched for it");
}

/// Of the log, and of each of its pages with its head.
const HEADER_BYTES: u64 = 32;
const PAGE_BYTES: u64 = 24 + 4096;

/// Changes a byte of the log, so far into its page number `page`.
fn flip_page(path: &Path, page: usize) {
    let mut log = fs::read(beside::wal(path)).unwrap();
    log[HEADER_BYTES as usize + page * PAGE_BYTES as usize + 100] ^= 1;
    fs::write(beside::wal(path), log).unwrap();
}

#[test]
fn a_log_that_is_lost_leaves_every_zero_doubted_until_somebody_vouches_for_it() {
    let (_dir, path) = killed();
    fs::remove_file(beside::wal(&path)).unwrap();
    is_doubted_until_vouched_for(&path, "no log");

    let (_dir, path) = killed();
    flip_page(&path, 0);
    is_doubted_until_vouched_for(&path, "a page of the log");
}

/// What is left looks whole, or as if a power cut had torn it.
#[test]
fn a_log_that_was_cut_off_or_whose_last_transaction_is_damaged_is_told_too() {
    let (_dir, path) = killed();
    let whole = fs::metadata(beside::wal(&path)).unwrap().len();
    for bytes in [0, 31, 32, HEADER_BYTES + PAGE_BYTES, whole - PAGE_BYTES, whole - 1000] {
        let (_dir, path) = killed();
        fs::File::options().write(true).open(beside::wal(&path)).unwrap().set_len(bytes).unwrap();
        is_doubted_until_vouched_for(&path, &format!("{bytes} of {whole} bytes of the log"));
    }
    let (_dir, path) = killed();
    flip_page(&path, ((whole - HEADER_BYTES) / PAGE_BYTES - 1) as usize);
    is_doubted_until_vouched_for(&path, "the last page of the log");
}

/// The start that finds a loss writes down what follows from it, before anything else is written. That is known to be in the log.
#[test]
fn what_a_start_wrote_down_of_a_loss_and_is_lost_again_is_told_again() {
    let (_dir, path) = killed();
    fs::remove_file(beside::wal(&path)).unwrap();
    let (store, restored, ..) = open(&path);
    assert_eq!(doubts(&restored).len(), 1);
    let killed_again = folder();
    copy(path.parent().unwrap(), killed_again.path());
    store.close().unwrap();
    let path = killed_again.path().join("store.db");
    fs::write(beside::wal(&path), []).unwrap();
    is_doubted_until_vouched_for(&path, "the log of a start");
}

#[test]
fn what_is_no_file_and_has_the_log_s_name_is_put_aside_and_the_log_is_lost() {
    for make in ["mkdir", "mkfifo"] {
        let (_dir, path) = killed();
        fs::remove_file(beside::wal(&path)).unwrap();
        assert!(Command::new(make).arg(beside::wal(&path)).status().unwrap().success());
        is_doubted_until_vouched_for(&path, make);
        assert!(beside::wal(&beside::beside(&path, ".damaged-1")).exists(), "{make}: it is kept");
    }
}

/// A power cut tears a transaction that was not acknowledged: the mark does not know of it.
#[test]
fn a_log_whose_end_is_torn_leaves_no_zero_doubted() {
    let (_dir, path) = killed();
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, None)]).unwrap();
    let mark = fs::read(beside::open_mark(&path)).unwrap();
    write(&store, vec![sample_record(2, 42)]).unwrap();
    let torn = folder();
    copy(path.parent().unwrap(), torn.path());
    let path = torn.path().join("store.db");
    assert_ne!(fs::read(beside::open_mark(&path)).unwrap(), mark);
    fs::write(beside::open_mark(&path), mark).unwrap();
    let log = fs::read(beside::wal(&path)).unwrap();
    fs::write(beside::wal(&path), &log[..log.len() - 1000]).unwrap();
    assert_eq!(start(&path), (vec![], 0));
}

#[test]
fn a_first_start_and_one_after_a_clean_stop_leave_no_zero_doubted() {
    let dir = folder();
    let path = dir.path().join("store.db");
    assert_eq!(start(&path), (vec![], 0), "no file at all");
    filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, Some(WHY)), doubt(PATCH, None)]).unwrap();
    store.close().unwrap();
    assert!(!beside::wal(&path).exists(), "a clean stop leaves no log");
    assert_eq!(start(&path), (vec![], 0), "a clean stop");
}

#[test]
fn a_database_that_is_lost_leaves_every_zero_doubted_until_somebody_vouches_for_it() {
    for bytes in [None, Some(0), Some(100), Some(4096), Some(8192)] {
        let dir = folder();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![doubt(PATCH, Some(WHY))]).unwrap();
        store.close().unwrap();
        match bytes {
            None => fs::remove_file(&path).unwrap(),
            Some(bytes) => fs::File::options().write(true).open(&path).unwrap().set_len(bytes).unwrap(),
        }
        is_doubted_until_vouched_for(&path, &format!("{bytes:?} bytes of the database"));
    }
}

/// Each patch gets its set from the plain file, and each is doubted: no row says anything of any of them.
#[test]
fn without_a_database_every_patch_of_the_plain_file_is_served_and_doubted() {
    let dir = folder();
    let path = dir.path().join("store.db");
    filled(&path);
    let other = with_id(ModelSet { patch: "right_forearm".to_owned(), ..model_set(3) });
    let (store, ..) = open(&path);
    write(&store, vec![Record::ModelSet(Arc::new(other.clone())), activated(&other)]).unwrap();
    store.close().unwrap();
    fs::remove_file(&path).unwrap();
    for time in ["first", "second"] {
        let (db, restored, _) = Db::open(&path).unwrap();
        let patches =
            |named: &[(String, String)]| named.iter().map(|(patch, _)| patch.clone()).collect::<BTreeSet<_>>();
        let both = [PATCH.to_owned(), other.patch.clone()].into();
        assert_eq!(
            (patches(&restored.active), patches(&doubts(&restored))),
            (both, patches(&restored.active)),
            "{time}"
        );
        db.close().unwrap();
    }
}

/// Somebody laid an old database beside the plain file of a newer one.
#[test]
fn a_database_older_than_its_plain_file_leaves_every_zero_doubted() {
    let dir = folder();
    let path = dir.path().join("store.db");
    let [first, _] = filled(&path);
    let old = fs::read(&path).unwrap();
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, Some(WHY)), activated(&first)]).unwrap();
    store.close().unwrap();
    fs::write(&path, old).unwrap();
    is_doubted_until_vouched_for(&path, "an old database");
}

/// A start that finds a loss is killed before each of its calls. Whatever it has put right by then, the next one tells the
/// loss and doubts the zero.
#[test]
fn a_loss_is_told_and_the_zero_doubted_wherever_the_start_that_found_it_is_killed() {
    let tools = folder();
    let shim = shim(&tools);
    let [test, variable] = OPENING;
    let damages: [(&str, Damage); 5] = [
        ("no log", |path| fs::remove_file(beside::wal(path)).unwrap()),
        ("a log that was cut off", |path| fs::write(beside::wal(path), []).unwrap()),
        ("a page of the log", |path| flip_page(path, 0)),
        ("no database", |path| fs::remove_file(path).unwrap()),
        ("a database of 0 bytes", |path| fs::write(path, []).unwrap()),
    ];
    for (what, damage) in damages {
        let count = tools.path().join("calls");
        let (_dir, path) = killed();
        damage(&path);
        let (_, lines) = start(&path);
        let (_dir, path) = killed();
        damage(&path);
        let fault = [("FAULT_COUNT", count.to_str().unwrap())];
        assert!(told(&shim, test, variable, &path, &fault).iter().any(|line| line == "opened"), "{what}");
        let calls: u64 = fs::read_to_string(&count).unwrap().trim().parse().unwrap();
        for call in 1..=calls {
            let (_dir, path) = killed();
            damage(&path);
            let fault = [("FAULT", "kill"), ("FAULT_AT", &*call.to_string())];
            let has_told = told(&shim, test, variable, &path, &fault).iter().any(|line| line == "opened");
            let what = format!("{what}, killed at call {call} of {calls}");
            let (doubted, told) = start(&path);
            assert_eq!(doubted, [PATCH], "{what}");
            assert!(told > 0 || has_told || call == calls, "{what}: the loss is not told");
            // Of a database that was made anew and is not whole yet more is told than of none.
            assert!(told <= lines || !what.contains("log"), "{what}: {told} lines tell what is told in {lines}");
        }
        println!("{what}: {calls} calls");
    }
}

/// A copy of the log that stops for want of room is none: it would take the room that the next start needs.
#[test]
fn of_a_log_that_there_is_no_room_to_keep_no_part_stays() {
    let tools = folder();
    let (shim, count) = (shim(&tools), tools.path().join("calls"));
    let [test, variable] = OPENING;
    let damaged = || {
        let (dir, path) = killed();
        flip_page(&path, 0);
        (dir, path)
    };
    let (_dir, path) = damaged();
    told(&shim, test, variable, &path, &[("FAULT_COUNT", count.to_str().unwrap())]);
    let calls: u64 = fs::read_to_string(&count).unwrap().trim().parse().unwrap();
    let mut without_copy = 0;
    for call in 1..=calls {
        let (_dir, path) = damaged();
        let log = fs::read(beside::wal(&path)).unwrap();
        told(&shim, test, variable, &path, &[("FAULT", "full"), ("FAULT_AT", &call.to_string())]);
        match fs::read(beside::wal(&beside::beside(&path, ".damaged-1"))) {
            Ok(kept) => assert!(kept == log, "no room at call {call} of {calls}: {} bytes", kept.len()),
            Err(_) => without_copy += 1,
        }
    }
    assert!(without_copy > 5, "{without_copy} of {calls}");
}
