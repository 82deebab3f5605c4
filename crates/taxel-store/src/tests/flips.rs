//! Random damage to each file of a store: it always opens, never serves anything false, and tells what is lost.
//!
//! `TAXEL_STORE_FLIPS=10000 cargo test -p taxel-store --release flips` for more; `TAXEL_STORE_SEED=N` repeats one.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use taxel_engine::calibration::SessionState;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;

use super::fixture::*;
use crate::beside;
use crate::db::Db;

/// Flips of a run unless the environment says otherwise.
const FLIPS: u64 = 200;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// The seeds of a run.
fn seeds() -> impl Iterator<Item = u64> {
    let first = number("TAXEL_STORE_SEED");
    let flips = if first.is_some() { 1 } else { number("TAXEL_STORE_FLIPS").unwrap_or(FLIPS) };
    let first = first.unwrap_or(1);
    first..first + flips
}

/// Changes one byte: in a third of the cases within the header, in a third within the first page, else anywhere.
fn flip(bytes: &mut [u8], random: &mut Random) -> String {
    let within = [100, 4096, bytes.len()][random.below(3)].min(bytes.len());
    let (at, by) = (random.below(within), 1 + random.below(255) as u8);
    bytes[at] ^= by;
    format!("byte {at} xor {by:#04x}")
}

/// Opens a damaged store twice and looks at all that it serves.
fn check(path: &Path, sets: &[ModelSet; 2], what: &str) {
    let known = sets.clone().map(|set| format!("{set:?}"));
    let all: Vec<_> = (0..40).map(sample).collect();
    let opened = Db::open(path);
    let (db, restored, quarantined) = opened.unwrap_or_else(|error| panic!("{what}: {error}"));
    // The plain file is whole, so that the force goes on with the right set whatever became of the database.
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}: {quarantined:?}");
    let readable = sets_in(&db, &restored);
    assert!(readable.len() == restored.model_sets.len(), "{what}: a set that is listed cannot be read");
    assert!(readable.iter().all(|set| known.contains(set)), "{what}: a set was changed");
    let found = db.samples(2).map(|found| found.samples).unwrap_or_default();
    assert!(found.iter().all(|sample| all.contains(sample)), "{what}: a sample was changed");
    let everything = restored.model_sets.len() == 2 && restored.sessions.len() == 2 && found.len() == 40;
    assert!(everything || !quarantined.is_empty(), "{what}: what is lost is not told");
    db.close().unwrap();
    let (db, restored, _) = Db::open(path).unwrap_or_else(|error| panic!("{what}, again: {error}"));
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}, again");
    db.close().unwrap();
}

#[test]
fn a_flipped_byte_of_the_database_keeps_no_store_from_opening_with_its_active_set() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    let (whole, active) = (fs::read(&path).unwrap(), fs::read(beside::active(&path)).unwrap());
    let mut aside = 0;
    for seed in seeds() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        let mut bytes = whole.clone();
        let what = format!("TAXEL_STORE_SEED={seed}, {}", flip(&mut bytes, &mut Random(seed)));
        fs::write(&path, &bytes).unwrap();
        fs::write(beside::active(&path), &active).unwrap();
        check(&path, &sets, &what);
        if let Ok(kept) = fs::read(dir.path().join("store.db.damaged-1")) {
            aside += 1;
            assert!(kept == bytes, "{what}: what was damaged is not kept as it was");
        }
    }
    println!("{aside} of {} were kept aside", seeds().count());
    assert!(aside > 0 || seeds().count() == 1);
}

#[test]
fn a_flipped_byte_of_the_log_loses_at_most_what_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    // Killed with its log: session 3 with a sample in each of ten transactions.
    let (mut db, ..) = Db::open(&path).unwrap();
    db.write([session(3, SessionState::Ramping), ramp(3, 0)].iter()).unwrap();
    for index in 0..10 {
        db.write([sample_record(3, index)].iter()).unwrap();
    }
    let files = [path.clone(), beside::wal(&path), beside::active(&path), beside::open_mark(&path)];
    let files = files.map(|file| (file.file_name().unwrap().to_owned(), fs::read(&file).unwrap()));
    let mut told = 0;
    for seed in seeds() {
        let dir = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, bytes)| fs::write(dir.path().join(name), bytes).unwrap());
        let path = dir.path().join("store.db");
        let mut log = fs::read(beside::wal(&path)).unwrap();
        let what = format!("TAXEL_STORE_SEED={seed}, {} of the log", flip(&mut log, &mut Random(seed)));
        fs::write(beside::wal(&path), &log).unwrap();
        let (db, restored, quarantined) = Db::open(&path).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}");
        let found = db.samples(3).map(|found| found.samples).unwrap_or_default();
        assert!(found.iter().enumerate().all(|(index, found)| *found == sample(index as u64)), "{what}");
        assert!(found.len() >= 10 || !quarantined.is_empty(), "{what}: {} samples, nothing told", found.len());
        told += usize::from(!quarantined.is_empty());
        db.close().unwrap();
        if !quarantined.is_empty() {
            let kept = fs::read(dir.path().join("store.db.damaged-1-wal")).unwrap();
            assert!(kept == log, "{what}: the damaged log is not kept");
        }
    }
    println!("{told} of {} told a loss", seeds().count());
    assert!(told > 0 || seeds().count() == 1);
}

#[test]
fn a_flipped_byte_of_the_plain_file_changes_nothing_and_is_mended() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    let whole = fs::read(beside::active(&path)).unwrap();
    for seed in seeds() {
        let mut bytes = whole.clone();
        let what = format!("TAXEL_STORE_SEED={seed}, {} of the plain file", flip(&mut bytes, &mut Random(seed)));
        fs::write(beside::active(&path), &bytes).unwrap();
        let (db, restored, quarantined) = Db::open(&path).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}");
        assert_eq!(restored.model_sets.len(), 2, "{what}");
        assert_eq!(quarantined.len(), 1, "{what}: {quarantined:?}");
        db.close().unwrap();
        assert!(fs::read(beside::active(&path)).unwrap() == whole, "{what}: it is not mended");
    }
}

#[test]
fn a_log_that_is_missing_after_a_kill_is_told_and_one_after_a_clean_stop_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (db, _, quarantined) = Db::open(&path).unwrap();
    assert_eq!(quarantined, []);
    let (database, mark) = (fs::read(&path).unwrap(), fs::read(beside::open_mark(&path)).unwrap());
    db.close().unwrap();
    let killed = tempfile::tempdir().unwrap();
    let path = killed.path().join("store.db");
    fs::write(&path, database).unwrap();
    fs::write(beside::open_mark(&path), mark).unwrap();
    let (_, _, quarantined) = Db::open(&path).unwrap();
    assert_eq!(quarantined.len(), 1, "{quarantined:?}");
    assert!(quarantined[0].to_string().contains("write-ahead log") && quarantined[0].reason.contains("missing"));
}

#[test]
fn without_any_database_the_active_set_comes_from_the_plain_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [_, second] = filled(&path);
    fs::remove_file(&path).unwrap();
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!(restored.active, [(PATCH.to_owned(), second.id.clone())]);
    assert!(!quarantined.is_empty());
    // It can be activated again, and what follows is stored as ever.
    write(&store, vec![Record::ModelSet(Arc::new(second.clone())), activated(&second)]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!((restored.active, quarantined.len()), (vec![(PATCH.to_owned(), second.id)], 0));
}
