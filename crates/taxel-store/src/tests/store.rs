//! The ordinary course of things.

use std::fs::{self, File};
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use rusqlite::Connection;
use taxel_engine::calibration::SessionState;
use taxel_engine::counts::SharedCounts;
use taxel_engine::record::{Record, Sample};
use taxel_engine::snapshot::TareView;
use taxel_skin::CountRange;

use super::fixture::*;
use crate::{Durability, Store, StoreError, StoreEvent, beside};

#[test]
fn a_restart_finds_everything_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    let ids: Vec<_> = restored.model_sets.iter().map(|set| set.id.as_str()).collect();
    assert_eq!(ids, [&sets[0].id, &sets[1].id]);
    assert_eq!(format!("{:?}", set_of(&store, &sets[0].id).unwrap()), format!("{:?}", sets[0]));
    assert_eq!(format!("{:?}", restored.model_sets[1].at_hand), format!("{:?}", Some(&sets[1])));
    assert_eq!(restored.active, [(PATCH.to_owned(), sets[1].id.clone())]);
    assert_eq!(restored.next_session, 3);
    assert_eq!(restored.sessions[0].state, SessionState::Active);
    let view = &restored.sessions[1];
    assert_eq!((view.state, view.accepted, view.durable, view.ramps), (SessionState::Interrupted, 40, 40, 1));
    assert!(view.reason.contains("RAMPING"), "{}", view.reason);
    assert_eq!(restored.problems, [""; 0]);
    let samples = samples_of(&store, 2).unwrap();
    assert_eq!(samples.samples, (0..40).map(sample).collect::<Vec<_>>());
    assert_eq!(samples.ramps[0].taxels, sets[0].baseline);
    // It goes on where it stopped.
    write(&store, vec![session(2, SessionState::Ramping), ramp(2, 1), sample_record(2, 40)]).unwrap();
    store.close().unwrap();
    let (_, restored, ..) = open(&path);
    assert_eq!(restored.sessions[1].accepted, 41);
    assert_eq!(restored.sessions[1].ramps, 2);
}

/// Wide counts and bytes that would also make wide ones: each comes back as what it was.
/// Over the service the audit log takes a role.
#[test]
fn its_owner_alone_may_read_a_store_and_one_that_was_salvaged() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!((mode(&path), mode(&beside::wal(&path))), (0o600, 0o600));
    store.close().unwrap();
    let pages = fs::metadata(&path).unwrap().len() / 4096;
    File::options().write(true).open(&path).unwrap().write_all_at(&[0xFF; 4096], (pages - 1) * 4096).unwrap();
    let _salvaged = crate::salvage::salvage(&path).unwrap();
    assert_eq!(mode(&path), 0o600);
}

#[test]
fn counts_of_every_width_come_back_as_they_were() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    let range = CountRange::to(4095).unwrap();
    let wide = |index: u64| {
        let words: Vec<u16> = (0..4).map(|taxel| ((index * 797 + taxel * 1021) % 4096) as u16).collect();
        Sample { counts: SharedCounts::Words(words.into(), range), ..sample(index) }
    };
    // As words these would be a greatest count of 4095 and one count.
    let bytes = Sample { counts: vec![0xFF, 0x0F, 0x01, 0x02].into(), ..sample(60) };
    let mut all: Vec<Sample> = (40..60).map(wide).collect();
    all.push(bytes);
    let record = |(index, sample): (u64, Sample)| Record::Sample { session: 2, index, sample };
    write(&store, (40..).zip(all.clone()).map(record).collect()).unwrap();
    assert_eq!(samples_of(&store, 2).unwrap().samples[40..], all);
    store.close().unwrap();
    let (store, _, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    assert_eq!(samples_of(&store, 2).unwrap().samples[40..], all);
    store.close().unwrap();
    // The page of another table is no page any more, so that the whole file is read row by row into a new one.
    break_root_of(&path, "tares");
    let (store, _, quarantined, _events) = open(&path);
    assert!(!quarantined.is_empty());
    assert_eq!(samples_of(&store, 2).unwrap().samples[40..], all, "{quarantined:?}");
}

/// Makes the first page of a table something that is no page.
fn break_root_of(path: &Path, table: &str) {
    let root = |column: &str| -> u64 {
        let other = Connection::open(path).unwrap();
        other.query_row(column, [], |row| row.get(0)).unwrap()
    };
    let page = root(&format!("SELECT rootpage FROM sqlite_schema WHERE name = '{table}'"));
    let page_bytes = root("PRAGMA page_size");
    let mut bytes = std::fs::read(path).unwrap();
    bytes[((page - 1) * page_bytes) as usize] = 0x77;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn samples_are_read_with_all_that_was_submitted_before() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let (store, ..) = open(&path);
    store.submit(quiet(vec![session(2, SessionState::Review), sample_record(2, 40)])).unwrap();
    store.submit(quiet(vec![sample_record(2, 41)])).unwrap();
    let found = samples_of(&store, 2).unwrap();
    assert_eq!(found.samples, (0..42).map(sample).collect::<Vec<_>>());
    assert_eq!(samples_of(&store, 1).unwrap().samples, [], "a session without a ramp has none");
    store.close().unwrap();
}

#[test]
fn failed_and_aborted_sessions_keep_their_samples_for_another_ramp() {
    for state in [SessionState::Failed, SessionState::Aborted] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let (store, ..) = open(&path);
        write(&store, vec![session(2, state)]).unwrap();
        store.close().unwrap();
        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(quarantined, []);
        assert_eq!(restored.sessions[1].state, state);
        let samples = samples_of(&store, 2).unwrap();
        assert_eq!((samples.ramps.len(), samples.samples.len()), (1, 40), "{state:?}");
    }
}

#[test]
fn samples_that_nobody_waits_for_become_durable_and_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _, _, events) = open(&dir.path().join("store.db"));
    store.submit(quiet(vec![session(1, SessionState::Ramping), sample_record(1, 0)])).unwrap();
    let patience = Duration::from_secs(60);
    assert_eq!(events.recv_timeout(patience).unwrap(), StoreEvent::Durable { session: 1, samples: 1 });
    for index in 1..200 {
        store.submit(quiet(vec![sample_record(1, index)])).unwrap();
    }
    store.close().unwrap();
    let counts: Vec<_> = events
        .iter()
        .map(|event| match event {
            StoreEvent::Durable { session: 1, samples } => samples,
            other => panic!("{other:?}"),
        })
        .collect();
    assert!(counts.is_sorted(), "{counts:?}");
    assert_eq!(counts.last(), Some(&200), "closing flushes the last group");
}

#[test]
fn a_tare_keeps_what_is_not_a_number() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    let tare = TareView { noise_median: f64::NAN, reason: "at rest".to_owned(), ..TareView::default() };
    let mut baseline = model_set(0).baseline;
    baseline[2].mean = f64::NAN;
    write(&store, vec![Record::Tared { patch: PATCH.to_owned(), tare, baseline }]).unwrap();
    store.close().unwrap();
    let stored: (String, Option<f64>, Vec<u8>) = Connection::open(&path)
        .unwrap()
        .query_row("SELECT reason, noise_median, baseline FROM tares", [], |row| {
            Ok((row.get(0)?, row.get(1)?, row.get(2)?))
        })
        .unwrap();
    assert_eq!((stored.0.as_str(), stored.1), ("at rest", None));
    assert!(crate::rows::baseline_from_blob(&stored.2).unwrap()[2].mean.is_nan());
}

#[test]
fn the_same_model_set_twice_is_one() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let set = Arc::new(model_set(1));
    let (store, ..) = open(&path);
    write(&store, vec![Record::ModelSet(set.clone()), Record::ModelSet(set.clone())]).unwrap();
    write(&store, vec![Record::ModelSet(set)]).unwrap();
    store.close().unwrap();
    let rows: i64 =
        Connection::open(&path).unwrap().query_row("SELECT count(*) FROM model_sets", [], |row| row.get(0)).unwrap();
    assert_eq!(rows, 1);
}

#[test]
fn nothing_is_changed_or_deleted_even_by_others() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    let other = Connection::open(&path).unwrap();
    for statement in [
        "DELETE FROM samples",
        "UPDATE samples SET pressure_kpa = 0",
        "DELETE FROM model_sets",
        "UPDATE model_sets SET json = x''",
        "DELETE FROM activations",
        "UPDATE activations SET model_set = ''",
        "DELETE FROM ramps",
        "DELETE FROM sessions",
    ] {
        let refused = other.execute(statement, []).unwrap_err().to_string();
        assert!(refused.contains("append-only") || refused.contains("never deleted"), "{statement}: {refused}");
    }
}

#[test]
fn a_second_process_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (_store, ..) = open(&path);
    let second = Store::open(&path, Box::new(|_| ()));
    assert_eq!(second.unwrap_err(), StoreError::InUse { path });
}

#[test]
fn the_log_stays_short() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let (store, ..) = open(&path);
    write(&store, vec![session(1, SessionState::Taring)]).unwrap();
    let rest = model_set(0).baseline[0];
    let mut longest = 0;
    for ramp in 0..24 {
        write(&store, vec![began(1, ramp, vec![rest; 25_000])]).unwrap();
        longest = longest.max(std::fs::metadata(dir.path().join("store.db-wal")).unwrap().len());
    }
    assert!(longest < 5_500_000, "{longest} bytes after 24 records of 400 kB each");
    store.close().unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() > 9_000_000);
}

#[test]
fn a_store_in_memory_does_the_same_and_says_so() {
    let store = Store::in_memory(Box::new(|_| ())).unwrap();
    let set = model_set(1);
    let records = vec![Record::ModelSet(Arc::new(set.clone())), activated(&set)];
    assert_eq!(write(&store, records), Ok(Durability::InMemory));
    store.close().unwrap();
}
