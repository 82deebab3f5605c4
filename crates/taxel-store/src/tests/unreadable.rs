//! A sector of the disk that cannot be read any more: `disk_faults.c` is preloaded into a process that opens the store.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use taxel_engine::model_set::ModelSet;
use tempfile::TempDir;

use super::disk::{folder, shim, told};
use super::fixture::*;
use crate::Store;

const CHILD: &str = "TAXEL_STORE_UNREADABLE_CHILD";
const PAGE_BYTES: u64 = 4096;

/// Runs in the child: opens the store, says what it holds and what is damaged, and closes it.
#[test]
fn unreadable_child() {
    let Ok(path) = std::env::var(CHILD) else { return };
    match Store::open(Path::new(&path), Box::new(|_| ())) {
        Ok((store, restored, quarantined)) => {
            quarantined.iter().for_each(|damage| println!("\ndamaged {damage}"));
            restored.active.iter().for_each(|(_, id)| println!("\nactive {id}"));
            let sound = restored.model_sets.iter().filter(|set| set_of(&store, &set.id).is_ok());
            sound.for_each(|set| println!("\nset {}", set.id));
            restored.sessions.iter().for_each(|view| println!("\nsession {}", view.number));
            let samples = samples_of(&store, 2).map_or(0, |found| found.samples.len());
            println!("\nsamples {samples}");
            store.close().unwrap();
        }
        Err(error) => println!("\nrefused {error}"),
    }
}

/// What a child said, by its first word.
struct Said(Vec<String>);

impl Said {
    fn of(&self, word: &str) -> BTreeSet<&str> {
        self.0.iter().filter_map(|line| line.strip_prefix(word)?.strip_prefix(' ')).collect()
    }
}

/// A disk with such a store: closed, or as a kill leaves it, most of it in the log.
fn disk(closed: bool) -> (TempDir, [ModelSet; 2]) {
    let (disk, work) = (folder(), folder());
    let path = work.path().join("store.db");
    let sets = filled(&path);
    let store = (!closed).then(|| {
        let (store, ..) = open(&path);
        write(&store, vec![sample_record(2, 40)]).unwrap();
        store
    });
    copy(work.path(), disk.path());
    drop(store);
    (disk, sets)
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// Opens the store with each page of one of its files unreadable in turn. No page takes more than one kind of thing along.
/// Gives how many pages there are, and how many samples were lost at most.
fn with_each_page_of(file: &str, closed: bool) -> (u64, usize) {
    let tools = folder();
    let shim = shim(&tools);
    let (master, sets) = disk(closed);
    let newest = sets[1].id.clone();
    let sets: BTreeSet<&str> = sets.iter().map(|set| &*set.id).collect();
    let samples = if closed { 40 } else { 41 };
    let pages = fs::metadata(master.path().join(file)).unwrap().len().div_ceil(PAGE_BYTES);
    let mut lost_most = 0;
    for page in 0..pages {
        let folder = folder();
        copy(master.path(), folder.path());
        let (path, bad) = (folder.path().join("store.db"), folder.path().join(file));
        let (what, page) = (format!("page {page} of {file}"), page.to_string());
        let fault = [("FAULT", "unreadable"), ("FAULT_OF", bad.to_str().unwrap()), ("FAULT_AT", &page)];
        let said = Said(told(&shim, "tests::unreadable::unreadable_child", CHILD, &path, &fault));
        let damaged = said.of("damaged");
        assert_eq!(said.of("refused"), BTreeSet::new(), "{what}");
        // The plain file has the active set where the database lost it, and the other way about.
        assert_eq!(said.of("active"), [newest.as_str()].into(), "{what}: {damaged:?}");
        assert!(said.of("set").is_subset(&sets) && said.of("set").contains(newest.as_str()), "{what}: {damaged:?}");
        let there: usize = said.of("samples").first().unwrap().parse().unwrap();
        let whole = said.of("set") == sets && said.of("session") == ["1", "2"].into() && there == samples;
        assert!(whole || !damaged.is_empty(), "{what}: what is lost is not told: {:?}", said.0);
        let lost = [said.of("set") != sets, said.of("session").len() < 2, there < samples];
        assert!(lost.iter().filter(|lost| **lost).count() <= 1, "{what}: {:?}", said.0);
        lost_most = lost_most.max(samples - there);
        println!("{what}: {} sets, {} sessions, {there} samples", said.of("set").len(), said.of("session").len());
    }
    (pages, lost_most)
}

#[test]
fn a_page_of_the_database_that_cannot_be_read_keeps_no_store_from_opening() {
    let (pages, _) = with_each_page_of("store.db", true);
    assert!(pages > 10, "{pages} pages");
}

#[test]
fn a_page_of_the_log_that_cannot_be_read_costs_at_most_what_was_in_the_log() {
    let (pages, lost) = with_each_page_of("store.db-wal", false);
    assert!(pages > 1 && lost <= 1, "{pages} pages, {lost} samples");
}

#[test]
fn a_plain_file_that_cannot_be_read_is_told_and_costs_nothing() {
    assert_eq!(with_each_page_of("store.db-active", true).1, 0);
}
