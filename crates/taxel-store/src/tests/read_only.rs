//! A disk that takes nothing keeps nobody from what is on it: a start hands out what can be read, and the store refuses all
//! else with the reason.

use std::collections::BTreeSet;

use super::disk::{folder, shim, told};
use super::fixture::*;
use crate::Store;
use crate::files::{COPY, LOG, beside};

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
    quarantined.iter().for_each(|damage| println!("\ntold {damage}"));
    restored.active.iter().for_each(|(_, id)| println!("\nactive {id}"));
    println!("\nsamples {}", samples_of(&store, 2).map_or(0, |found| found.samples.len()));
    println!("\nlog {}", entries(&store, u64::MAX, 9).unwrap().len());
    println!("\ndoubted {}", needs_confirmation(&restored));
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

/// A disk with a store, as a kill leaves it: the set in use and a sample are in the log alone.
fn disk() -> (TempDir, String) {
    let (disk, work) = (folder(), folder());
    let path = work.path().join("store.db");
    let [first, _] = filled(&path);
    let (store, ..) = open(&path);
    let used = Record::Activated { patch: PATCH.to_owned(), model_set: first.id.clone(), wall_ns: 0 };
    write(&store, vec![used, sample_record(2, 40), asked(1)]).unwrap();
    samples_of(&store, 2).unwrap();
    for entry in fs::read_dir(work.path()).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), disk.path().join(entry.file_name())).unwrap();
    }
    (disk, first.id)
}

fn content(disk: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(disk).unwrap().map(Result::unwrap);
    let mut files: Vec<_> =
        entries.map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap())).collect();
    files.sort();
    files
}

#[test]
fn on_a_read_only_disk_the_right_set_serves_and_commands_are_refused_in_words() {
    let tools = folder();
    let shim = shim(&tools);
    type Change = fn(&Path);
    let cases: [(&str, Change, &str, bool); 4] = [
        ("nothing", |_| (), "41", false),
        ("the file is damaged", |path| fs::write(path, "no database").unwrap(), "41", true),
        ("the log is lost", |path| fs::remove_file(beside(path, LOG)).unwrap(), "41", true),
        ("the copy is damaged", |path| fs::write(beside(path, COPY), "no database").unwrap(), "41", false),
    ];
    for (what, change, samples, doubted) in cases {
        let (disk, active) = disk();
        let path = disk.path().join("store.db");
        change(&path);
        let before = content(disk.path());
        let lines = told(&shim, "tests::read_only::read_only_child", CHILD, &path, &[("FAULT", "readonly")]);
        assert_eq!(said(&lines, "active"), BTreeSet::from([&*active]), "{what}: {lines:?}");
        assert_eq!(said(&lines, "samples"), BTreeSet::from([samples]), "{what}: {lines:?}");
        assert_eq!(said(&lines, "log"), BTreeSet::from(["1"]), "{what}: {lines:?}");
        assert_eq!(said(&lines, "doubted"), BTreeSet::from([&*doubted.to_string()]), "{what}: {lines:?}");
        assert_eq!(said(&lines, "told").is_empty(), !doubted, "{what}: {lines:?}");
        let refused = said(&lines, "refused");
        assert!(refused.iter().all(|why| why.contains("Read-only file system")), "{what}: {lines:?}");
        assert_eq!((refused.len(), said(&lines, "event").len()), (1, 1), "{what}: {lines:?}");
        assert_eq!(content(disk.path()), before, "{what}: nothing is changed");
    }
}

/// At whatever call the disk begins to refuse, the set in use serves.
#[test]
fn a_disk_that_refuses_from_any_call_of_a_start_on_serves_the_set_in_use() {
    let tools = folder();
    let shim = shim(&tools);
    let test = "tests::read_only::read_only_child";
    for (fault, damaged) in [("erofs", false), ("enospc", false), ("erofs", true), ("enospc", true)] {
        let count = tools.path().join("calls");
        let scene = || {
            let (disk, active) = disk();
            let path = disk.path().join("store.db");
            if damaged {
                fs::write(&path, "no database").unwrap();
            }
            (disk, path, active)
        };
        let (_disk, path, _) = scene();
        told(&shim, test, CHILD, &path, &[("FAULT_COUNT", count.to_str().unwrap())]);
        let calls: u64 = fs::read_to_string(&count).unwrap().trim().parse().unwrap();
        for call in 1..=calls {
            let (_disk, path, active) = scene();
            let lines = told(&shim, test, CHILD, &path, &[("FAULT", fault), ("FAULT_AT", &call.to_string())]);
            assert_eq!(said(&lines, "active"), BTreeSet::from([&*active]), "{fault} at {call}: {lines:?}");
            let (_, restored, ..) = open(&path);
            assert_eq!(restored.active[0].1, active, "{fault} at {call}, then");
        }
        assert!(calls > 10, "{calls}");
    }
}
