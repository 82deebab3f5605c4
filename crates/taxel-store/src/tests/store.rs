//! The ordinary course of things.

use std::os::unix::fs::PermissionsExt;
use std::time::Duration;

use taxel_engine::counts::Counts;
use taxel_engine::record::TakenZero;
use taxel_skin::CountRange;

use super::fixture::*;
use crate::{Store, StoreError, StoreEvent, check};

#[test]
fn a_restart_finds_everything_again() {
    let (_dir, path) = place();
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
    assert_eq!((restored.sessions[1].accepted, restored.sessions[1].ramps), (41, 2));
}

#[test]
fn loads_zeros_and_the_audit_log_come_back_and_numbers_go_on() {
    let (_dir, path) = place();
    let zero = TakenZero {
        mean: vec![0.1, f64::NAN],
        noise: vec![0.5, f64::NAN],
        pads: vec![Some(200.5), None],
        ..TakenZero::default()
    };
    let known = KeptZero {
        configured: Some(u32::MAX),
        needs_confirmation: Some("a load: 2 N".to_owned()),
        excused: Some("m-1".to_owned()),
        zero: Some(Arc::new(zero)),
    };
    let (store, ..) = open(&path);
    let noted = Record::Zero { patch: PATCH.to_owned(), zero: known.clone() };
    write(&store, vec![load(1), load(2), asked(1), asked(2), answered(1), noted]).unwrap();
    store.close().unwrap();
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((quarantined, restored.next_load), (vec![], 3));
    let given: Vec<_> = [load(1), load(2)]
        .into_iter()
        .map(|record| match record {
            Record::Load(load) => load,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(restored.loads, given);
    assert_eq!(format!("{:?}", restored.zeros), format!("{:?}", [(PATCH.to_owned(), known)]));
    // A new run numbers its requests anew.
    write(&store, vec![asked(1), answered(1)]).unwrap();
    let all = entries(&store, u64::MAX, 100).unwrap();
    let seen: Vec<_> = all.iter().map(|entry| (entry.number, entry.answered.is_some())).collect();
    assert_eq!(seen, [(3, true), (2, false), (1, true)]);
    assert_eq!(all[1].asked.as_ref().unwrap().who, "who 2");
    assert_eq!(entries(&store, 3, 1).unwrap()[0].number, 2);
    let twice = write(&store, vec![answered(1)]).unwrap_err();
    assert!(matches!(twice, StoreError::Unstorable { .. }), "{twice}");
}

/// Over the service the audit log takes a role.
#[test]
fn every_file_of_a_store_is_its_owners_alone_whatever_its_mode_was() {
    let (dir, path) = place();
    filled(&path);
    for entry in fs::read_dir(dir.path()).unwrap() {
        fs::set_permissions(entry.unwrap().path(), fs::Permissions::from_mode(0o644)).unwrap();
    }
    let (store, restored, ..) = open(&path);
    let set = Arc::new(model_set(3));
    write(&store, vec![Record::ModelSet(Arc::clone(&set)), activated(&set)]).unwrap();
    samples_of(&store, 2).unwrap(); // the copy is made by now
    assert_eq!(restored.model_sets.len(), 2);
    let mut names = Vec::new();
    for entry in fs::read_dir(dir.path()).unwrap() {
        let entry = entry.unwrap();
        assert_eq!(entry.metadata().unwrap().permissions().mode() & 0o777, 0o600, "{:?}", entry.file_name());
        names.push(entry.file_name().into_string().unwrap());
    }
    names.sort();
    assert_eq!(names, ["store.db", "store.db-copy", "store.db-lock", "store.db-wal"]);
}

#[test]
fn counts_of_every_width_come_back_as_they_were() {
    let (_dir, path) = place();
    filled(&path);
    let (store, ..) = open(&path);
    let range = CountRange::to(4095).unwrap();
    let wide = |index: u64| {
        let words: Vec<u16> = (0..4).map(|taxel| ((index * 797 + taxel * 1021) % 4096) as u16).collect();
        Sample { counts: Counts::new(&words, range).into(), ..sample(index) }
    };
    let bytes = Sample { counts: [0xFF, 0x0F, 0x01, 0x02].into(), pressure_kpa: -0.0, ..sample(60) };
    let mut all: Vec<Sample> = (40..60).map(wide).collect();
    all.push(bytes);
    let record = |(index, sample): (u64, Sample)| Record::Sample { session: 2, index, sample };
    write(&store, (40..).zip(all.clone()).map(record).collect()).unwrap();
    store.close().unwrap();
    let (store, _, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    assert_eq!(samples_of(&store, 2).unwrap().samples[40..], all);
}

#[test]
fn samples_that_nobody_waits_for_become_durable_by_themselves() {
    let (_dir, path) = place();
    let (store, _, _, events) = open(&path);
    store.submit(quiet(vec![session(1, SessionState::Ramping), sample_record(1, 0)])).unwrap();
    let patience = Duration::from_secs(60);
    assert_eq!(events.recv_timeout(patience).unwrap(), StoreEvent::Durable { session: 1, samples: 1 });
    store.close().unwrap();
}

/// Nor in its log or its copy.
#[test]
fn what_was_deleted_is_in_no_file_and_its_number_is_not_used_again() {
    let (dir, path) = place();
    let [first, _] = filled(&path);
    let counts = b"these are the counts of a session!".to_vec();
    let (store, ..) = open(&path);
    let words: Vec<u16> = counts.as_chunks().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    let sample = Sample { counts: words.into(), ..sample(0) };
    write(&store, vec![session(5, SessionState::Ramping), Record::Sample { session: 5, index: 0, sample }]).unwrap();
    write(&store, vec![session(5, SessionState::Aborted)]).unwrap();
    samples_of(&store, 5).unwrap();
    let holds = |bytes: &[u8]| bytes.windows(counts.len()).any(|window| window == counts);
    let found =
        || fs::read_dir(dir.path()).unwrap().filter(|file| holds(&fs::read(file.as_ref().unwrap().path()).unwrap()));
    assert_eq!(found().count(), 2, "the log and the copy");
    let gone = Record::ModelSetDeleted { model_set: first.id.clone() };
    write(&store, vec![Record::SessionDeleted { session: 5 }, gone]).unwrap();
    samples_of(&store, 5).unwrap();
    assert_eq!(found().count(), 0);
    store.close().unwrap();
    let (_, restored, quarantined, _events) = open(&path);
    assert_eq!(quarantined, []);
    assert_eq!((restored.model_sets.len(), restored.sessions.len(), restored.next_session), (1, 2, 6));
}

#[test]
fn a_set_in_use_that_is_deleted_is_not_in_use_after_a_restart_also_if_it_is_imported_again() {
    let (_dir, path) = place();
    let [_, second] = filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![Record::ModelSetDeleted { model_set: second.id.clone() }]).unwrap();
    write(&store, vec![Record::ModelSet(Arc::new(second))]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined, _events) = open(&path);
    assert_eq!((restored.active, restored.model_sets.len(), quarantined), (vec![], 2, vec![]));
}

#[test]
fn a_second_process_is_refused_and_told_which_has_the_store() {
    let (_dir, path) = place();
    let (_store, ..) = open(&path);
    let second = Store::open(&path, Box::new(|_| ())).unwrap_err();
    assert_eq!(second, StoreError::InUse(Some(std::process::id())));
    let said = second.to_string();
    assert!(said.contains(&format!("in use by process {}: stop that one", std::process::id())), "{said}");
    assert_eq!(check(&path).unwrap_err(), second);
}

#[test]
fn the_log_stays_short() {
    let (dir, path) = place();
    let (store, ..) = open(&path);
    write(&store, vec![session(1, SessionState::Taring)]).unwrap();
    let rest = model_set(0).baseline[0];
    let mut longest = 0;
    for ramp in 0..24 {
        write(&store, vec![began(1, ramp, vec![rest; 25_000])]).unwrap();
        longest = longest.max(fs::metadata(dir.path().join("store.db-wal")).unwrap().len());
    }
    assert!(longest < 5_500_000, "{longest} bytes after 24 records of 400 kB each");
    store.close().unwrap();
}

#[test]
fn a_store_that_nobody_has_open_is_checked_where_it_lies() {
    let (dir, path) = place();
    filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![sample_record(2, 40), asked(1)]).unwrap();
    // As a kill leaves it.
    let killed = tempfile::tempdir().unwrap();
    for name in ["store.db", "store.db-wal", "store.db-copy", "store.db-lock"] {
        fs::copy(dir.path().join(name), killed.path().join(name)).unwrap();
    }
    let path = killed.path().join("store.db");
    let before = fs::read(&path).unwrap();
    let found = check(&path).unwrap();
    assert_eq!((found.model_sets, found.sessions, found.samples, found.damage), (2, 2, 41, vec![]));
    assert_eq!(fs::read(&path).unwrap(), before);
    let none = check(&killed.path().join("other.db")).unwrap_err().to_string();
    assert!(none.contains("there is none"), "{none}");
}
