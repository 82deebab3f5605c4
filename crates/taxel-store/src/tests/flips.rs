//! Random damage to a store: it always opens, and never serves anything that is not what was written.
//!
//! `TAXEL_STORE_FLIPS=10000 cargo test -p taxel-store flips` for more; `TAXEL_STORE_SEED=N` repeats one.

use super::fixture::*;
use crate::files::{COPY, LOG, beside};
use crate::{Store, StoreError};

/// Flips of a run unless the environment says otherwise.
const FLIPS: u64 = 200;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok()?.parse().ok()
}

/// The seeds of a run.
fn seeds() -> std::ops::Range<u64> {
    match number("TAXEL_STORE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 1..1 + number("TAXEL_STORE_FLIPS").unwrap_or(FLIPS),
    }
}

/// Changes one byte: in a third of the cases within the header, in a third within the first page, else anywhere.
fn flip(path: &Path, random: &mut Random) -> String {
    let mut bytes = fs::read(path).unwrap();
    let within = [100, 4096, bytes.len()][random.below(3)].min(bytes.len());
    let (at, by) = (random.below(within), 1 + random.below(255) as u8);
    bytes[at] ^= by;
    fs::write(path, bytes).unwrap();
    format!("byte {at} xor {by:#04x}")
}

/// Opens a damaged store and looks at all that it serves. Gives whether something was told.
fn check(path: &Path, sets: &[ModelSet; 2], what: &str) -> bool {
    let known = sets.clone().map(|set| format!("{set:?}"));
    let all: Vec<_> = (0..50).map(sample).collect();
    let (store, restored, found) = match Store::open(path, Box::new(|_| ())) {
        Ok(opened) => opened,
        // The number of the version is flipped, which nobody can tell from a newer program's.
        Err(StoreError::TooNew { .. }) => return true,
        Err(error) => panic!("{what}: {error}"),
    };
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}: {found:?}");
    let in_use: Vec<_> = restored.model_sets.iter().filter_map(|set| set.at_hand.as_ref()).collect();
    assert!(in_use.iter().all(|set| known.contains(&format!("{set:?}"))), "{what}: a set in use was changed");
    assert!(sets_in(&store, &restored).iter().all(|set| known.contains(set)), "{what}: a set was changed");
    for session in [2, 3] {
        let samples = samples_of(&store, session).map(|found| found.samples).unwrap_or_default();
        assert!(samples.iter().all(|sample| all.contains(sample)), "{what}: a sample was changed");
    }
    let everything = restored.model_sets.len() == 2 && restored.sessions.len() >= 2;
    assert!(everything || !found.is_empty(), "{what}: what is lost is not told");
    store.close().unwrap();
    let (_, again, ..) = open(path);
    assert_eq!(again.active, [(PATCH.to_owned(), sets[1].id.clone())], "{what}, again");
    !found.is_empty()
}

fn flipped(suffix: &str) {
    let (dir, path) = place();
    let sets = filled(&path);
    // As a kill leaves it: session 3 with a sample in each of ten commits.
    let (store, ..) = open(&path);
    write(&store, vec![session(3, SessionState::Ramping), ramp(3, 0)]).unwrap();
    for index in 0..10 {
        write(&store, vec![sample_record(3, index)]).unwrap();
    }
    let names = ["store.db", "store.db-wal", "store.db-copy", "store.db-lock"];
    let whole = names.map(|name| fs::read(dir.path().join(name)).unwrap());
    let mut told = 0;
    for seed in seeds() {
        let dir = tempfile::tempdir().unwrap();
        names.iter().zip(&whole).for_each(|(name, bytes)| fs::write(dir.path().join(name), bytes).unwrap());
        let path = dir.path().join("store.db");
        let flipped = flip(&beside(&path, suffix), &mut Random(seed));
        told += u32::from(check(&path, &sets, &format!("TAXEL_STORE_SEED={seed}, {flipped} of `{suffix}`")));
    }
    println!("{told} of {} flips in `store.db{suffix}` were told", seeds().end - seeds().start);
}

#[test]
fn a_flipped_byte_of_the_database_never_gives_a_model_that_was_not() {
    flipped("");
}

#[test]
fn a_flipped_byte_of_the_log_never_gives_a_model_that_was_not() {
    flipped(LOG);
}

#[test]
fn a_flipped_byte_of_the_copy_never_gives_a_model_that_was_not() {
    flipped(COPY);
}
