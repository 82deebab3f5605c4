//! A disk that takes nothing keeps nobody from what is on it: a start hands out what can be read, and the store refuses all
//! else with the reason.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;
use tempfile::TempDir;

use super::board_zeros::{WHY, doubt, doubts};
use super::disk::{folder, shim, told};
use super::fixture::*;
use super::lost::copy;
use crate::{Store, beside};

const CHILD: &str = "TAXEL_STORE_READ_ONLY_CHILD";

/// Runs in the child: opens the store, says what it holds and what is wrong, and tries to write.
#[test]
fn read_only_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    let (tell, events) = std::sync::mpsc::channel();
    let notify = Box::new(move |event| drop(tell.send(event)));
    let (store, restored, quarantined) = match Store::open(Path::new(&path), notify) {
        Ok(opened) => opened,
        Err(error) => return println!("\nstart {error}"),
    };
    quarantined.iter().for_each(|damage| println!("\ndamaged {damage}"));
    restored.active.iter().for_each(|(_, id)| println!("\nactive {id}"));
    doubts(&restored).iter().for_each(|(_, why)| println!("\ndoubt {why}"));
    println!("\nsets {}", restored.model_sets.len());
    match write(&store, vec![session(9, SessionState::Aborted)]) {
        Ok(_) => println!("\nwritten yes"),
        Err(error) => println!("\nrefused {error}"),
    }
    drop(store.close());
    events.iter().for_each(|event| println!("\nevent {event:?}"));
}

/// What a child said, by its first word.
fn said<'a>(lines: &'a [String], word: &str) -> BTreeSet<&'a str> {
    lines.iter().filter_map(|line| line.strip_prefix(word)?.strip_prefix(' ')).collect()
}

/// A disk with a store: closed, or as a kill leaves it. A doubt and a sample are the last that was written.
fn disk(closed: bool) -> (TempDir, String) {
    let (disk, work) = (folder(), folder());
    let path = work.path().join("store.db");
    let [_, second] = filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![doubt(PATCH, Some(WHY)), sample_record(2, 40)]).unwrap();
    if closed {
        store.close().unwrap();
        copy(work.path(), disk.path());
    } else {
        copy(work.path(), disk.path());
        drop(store);
    }
    (disk, second.id)
}

/// All that was on a disk is there at a start without a fault.
fn is_whole(path: &Path, what: &str) {
    let (store, restored, ..) = open(path);
    assert_eq!(restored.model_sets.len(), 2, "{what}");
    assert_eq!(doubts(&restored).len(), 1, "{what}");
    assert_eq!(samples_of(&store, 2).unwrap().samples.len(), 41, "{what}");
    store.close().unwrap();
}

/// How many calls that change something the child makes.
fn calls_of(shim: &Path, path: &Path, tools: &TempDir) -> u64 {
    let count = tools.path().join("calls");
    told(shim, "tests::read_only::read_only_child", CHILD, path, &[("FAULT_COUNT", count.to_str().unwrap())]);
    fs::read_to_string(count).unwrap().trim().parse().unwrap()
}

/// What was done to a store before a start.
#[derive(Clone, Copy, PartialEq)]
enum Before {
    Closed,
    Killed,
    /// Closed, and a byte of the header is wrong: all is there, and can be read with another header.
    Damaged,
    /// Closed, and another program has written it without a log.
    WithoutLog,
}

impl Before {
    fn on(self, path: &Path) {
        match self {
            Self::Closed | Self::Killed => {}
            Self::Damaged => {
                let mut bytes = fs::read(path).unwrap();
                bytes[20] ^= 0x55;
                fs::write(path, bytes).unwrap();
            }
            Self::WithoutLog => {
                let open = rusqlite::Connection::open(path).unwrap();
                open.pragma_update(None, "journal_mode", "delete").unwrap();
            }
        }
    }
}

/// A start meets the fault at each of its calls in turn. Every time the active set is served, and without damage all others;
/// where nothing can be written, that is said with the reason; and what was on the disk stays there.
fn at_each_call_of_a_start(fault: &str, reasons: &[&str], before: Before) {
    let tools = folder();
    let shim = shim(&tools);
    let master = disk(before != Before::Killed);
    let prepared = || {
        let folder = folder();
        copy(master.0.path(), folder.path());
        let path = folder.path().join("store.db");
        before.on(&path);
        (folder, path)
    };
    let calls = calls_of(&shim, &prepared().1, &tools);
    let mut refusals = 0;
    for call in 1..=calls {
        let (_folder, path) = prepared();
        let what = format!("{fault} at call {call} of {calls}");
        let fault = [("FAULT", fault), ("FAULT_AT", &*call.to_string())];
        let lines = told(&shim, "tests::read_only::read_only_child", CHILD, &path, &fault);
        assert_eq!(said(&lines, "start"), BTreeSet::new(), "{what}");
        assert_eq!(said(&lines, "active"), [master.1.as_str()].into(), "{what}: {lines:?}");
        assert_eq!(said(&lines, "doubt").len(), 1, "{what}: {lines:?}");
        assert!(before == Before::Damaged || said(&lines, "sets").contains("2"), "{what}: {lines:?}");
        if let Some(why) = said(&lines, "refused").first() {
            refusals += 1;
            assert!(reasons.iter().any(|reason| why.contains(reason)), "{what}: {why}");
            let events = said(&lines, "event");
            assert!(events.iter().any(|event| event.starts_with("Failed(")), "{what}: {lines:?}");
            let made_none = before == Before::Closed && why.contains("unable to open database file");
            assert!(!made_none || !beside::wal(&path).exists(), "{what}: a log that is none stays");
        }
        is_whole(&path, &what);
    }
    println!("{fault} at each of {calls} calls: {refusals} refusals");
    assert!(refusals > 0);
}

const FULL: [&str; 4] = ["full", "I/O error", "No space left", "unable to open"];
const EIO: [&str; 3] = ["I/O error", "Input/output error", "unable to open"];

#[test]
fn a_start_on_a_full_disk_hands_out_all_that_is_on_it() {
    at_each_call_of_a_start("enospc", &FULL, Before::Closed);
    at_each_call_of_a_start("enospc", &FULL, Before::Killed);
    at_each_call_of_a_start("enospc", &FULL, Before::WithoutLog);
}

/// At each call of a start that gives space back: how often it left that out and takes what is new, and of how many.
fn gives_nothing_back(fault: &str) -> (u64, u64) {
    let tools = folder();
    let shim = shim(&tools);
    let (disk, id) = disk(true);
    let path = disk.path().join("store.db");
    let rest = model_set(0).baseline[0];
    let (store, ..) = open(&path);
    write(&store, vec![session(3, SessionState::Aborted)]).unwrap();
    for ramp in 0..20 {
        write(&store, vec![began(3, ramp, vec![rest; 25_000])]).unwrap();
    }
    write(&store, vec![Record::SessionDeleted { session: 3, wall_ns: 7 }]).unwrap();
    store.close().unwrap();
    let copied = || {
        let folder = folder();
        copy(disk.path(), folder.path());
        let path = folder.path().join("store.db");
        (folder, path)
    };
    let calls = calls_of(&shim, &copied().1, &tools);
    let mut left_out = 0;
    for call in 1..=calls {
        let (_folder, path) = copied();
        let fault = [("FAULT", fault), ("FAULT_AT", &*call.to_string())];
        let lines = told(&shim, "tests::read_only::read_only_child", CHILD, &path, &fault);
        let served = ["active", "sets"].map(|word| said(&lines, word));
        assert_eq!(served, [[id.as_str()].into(), ["2"].into()], "call {call} of {calls}: {lines:?}");
        let is_as_it_was = fs::metadata(&path).unwrap().len() > 8_000_000;
        left_out += u64::from(is_as_it_was && said(&lines, "written").contains("yes"));
    }
    (left_out, calls)
}

/// Giving back space is the one change of a start that is left out where there is no room for it, and only there.
#[test]
fn a_start_that_has_no_room_to_give_back_space_takes_what_is_new() {
    let (left_out, calls) = gives_nothing_back("full");
    assert!(left_out > 10, "{left_out} of {calls}");
    let (left_out, calls) = gives_nothing_back("eio");
    assert_eq!(left_out, 0, "of {calls}: a disk that fails takes nothing any more");
}

#[test]
fn a_start_whose_disk_fails_once_hands_out_all_that_is_on_it() {
    at_each_call_of_a_start("eio", &EIO, Before::Closed);
    at_each_call_of_a_start("eio", &EIO, Before::Killed);
    at_each_call_of_a_start("eio", &EIO, Before::WithoutLog);
}

#[test]
fn a_damaged_store_on_a_full_disk_is_not_replaced_by_less_than_what_can_be_read() {
    at_each_call_of_a_start("enospc", &FULL, Before::Damaged);
}

#[test]
fn a_start_on_a_read_only_disk_hands_out_all_that_is_on_it_and_takes_it_for_no_damage() {
    let tools = folder();
    let shim = shim(&tools);
    for closed in [true, false] {
        let (folder, id) = disk(closed);
        let path = folder.path().join("store.db");
        let before: Vec<_> = [path.clone(), beside::wal(&path)].iter().map(|file| fs::read(file).ok()).collect();
        let fault = [("FAULT", "readonly")];
        let lines = told(&shim, "tests::read_only::read_only_child", CHILD, &path, &fault);
        let words = ["start", "damaged", "active", "sets"].map(|word| said(&lines, word));
        let expected = [[].into(), [].into(), [id.as_str()].into(), ["2"].into()];
        assert_eq!(words, expected, "closed: {closed}");
        assert_eq!(said(&lines, "doubt"), [WHY].into());
        let refused = said(&lines, "refused").first().copied().unwrap_or_default().to_owned();
        assert!(refused.contains("Read-only file system") && refused.contains("store.db"), "{refused}");
        let after: Vec<_> = [path.clone(), beside::wal(&path)].iter().map(|file| fs::read(file).ok()).collect();
        assert!(before == after, "closed: {closed}: a file was changed");
        is_whole(&path, "later");
    }
}

/// What a log lost is found again by the start that can note it.
#[test]
fn a_loss_that_a_read_only_disk_cannot_note_is_told_again_later() {
    let tools = folder();
    let shim = shim(&tools);
    let (folder, id) = disk(false);
    let path = folder.path().join("store.db");
    fs::remove_file(beside::wal(&path)).unwrap();
    for _ in 0..2 {
        let lines = told(&shim, "tests::read_only::read_only_child", CHILD, &path, &[("FAULT", "readonly")]);
        assert_eq!(said(&lines, "active"), [id.as_str()].into(), "{lines:?}");
        assert_eq!((said(&lines, "doubt").len(), said(&lines, "damaged").len()), (1, 1), "{lines:?}");
    }
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((doubts(&restored).len(), quarantined.len()), (1, 1));
    store.close().unwrap();
}

/// A process that may open few files: what cannot be opened is neither damaged nor on a disk that takes nothing.
#[test]
fn a_start_that_can_open_no_more_files_says_so_and_leaves_no_empty_log() {
    let (master, id) = disk(true);
    let (mut refusals, mut writes) = (0, 0);
    for most in 4..24 {
        let folder = folder();
        copy(master.path(), folder.path());
        let path = folder.path().join("store.db");
        let child = Command::new("sh")
            .args(["-c", "ulimit -n $0; exec \"$@\"", &most.to_string()])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "tests::read_only::read_only_child", "--nocapture", "--test-threads=1"])
            .env(CHILD, &path)
            .output()
            .unwrap();
        let lines: Vec<_> = String::from_utf8(child.stdout).unwrap().lines().map(str::to_owned).collect();
        let what = format!("{most} files: {lines:?}");
        assert!(!lines.iter().any(|line| line.contains("damaged on disk") || line.contains("Read-only")), "{what}");
        refusals += u64::from(lines.iter().any(|line| line.starts_with("refused ") || line.starts_with("start ")));
        if said(&lines, "written").contains("yes") {
            writes += 1;
            assert_eq!(said(&lines, "active"), [id.as_str()].into(), "{what}");
        }
        // SQLite's own log stays where something fails after it has the database.
        let no_log_was_made = lines.iter().any(|line| line.contains("unable to open database file"));
        assert!(!no_log_was_made || !beside::wal(&path).exists(), "{what}");
        is_whole(&path, &what);
    }
    assert!(refusals > 1 && writes > 1, "{refusals} refusals, {writes} writes");
}
