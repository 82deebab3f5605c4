//! What is kept, and what an operator does with a store that nobody has open.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::model_set::{ModelSet, Recalibrated};
use taxel_engine::record::Record;

use super::fixture::*;
use crate::db::Db;
use crate::{AuditFile, Retention, Store, StoreError, StoreFile, check, compact, sets_to_go};

/// Ten model sets, the first active, and ten sessions with samples, the last two of which wait for the operator.
fn grown(path: &Path) {
    let (store, ..) = open(path);
    for number in 1..=10 {
        let set = Arc::new(model_set(number));
        let state = if number > 8 { SessionState::Review } else { SessionState::Discarded };
        let mut records = vec![Record::ModelSet(set), session(number as u64, state), ramp(number as u64, 0)];
        records.extend((0..10).map(|index| sample_record(number as u64, index)));
        write(&store, records).unwrap();
    }
    write(&store, vec![activated(&model_set(1))]).unwrap();
    store.close().unwrap();
}

fn kept(limits: Retention) -> (Vec<i64>, Vec<u64>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path);
    let (store, now, quarantined) = Store::open_keeping(&path, &limits, Box::new(|_| ())).unwrap();
    assert_eq!(quarantined, []);
    store.close().unwrap();
    // The next start finds the same, and nothing that is missing.
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(quarantined, []);
    let sets: Vec<_> = restored.model_sets.iter().map(|set| set.created_wall_ns).collect();
    let sessions: Vec<_> = restored.sessions.iter().map(|view| view.number).collect();
    assert_eq!(now.model_sets.iter().map(|set| set.created_wall_ns).collect::<Vec<_>>(), sets);
    assert_eq!(now.sessions.iter().map(|view| view.number).collect::<Vec<_>>(), sessions);
    (sets, sessions)
}

#[test]
fn what_is_beyond_the_limits_goes_oldest_first_and_never_what_is_in_use() {
    let all = Retention::default();
    assert_eq!(kept(all), ((1..=10).collect(), (1..=10).collect()));
    assert_eq!(kept(Retention { model_sets: Some(3), ..all }).0, [1, 9, 10], "the first one is active");
    assert_eq!(kept(Retention { model_sets: Some(0), ..all }).0, [1]);
    assert_eq!(kept(Retention { sessions: Some(4), ..all }).1, [7, 8, 9, 10]);
    assert_eq!(kept(Retention { sessions: Some(0), ..all }).1, [9, 10], "they wait for the operator");
    assert_eq!(kept(Retention { samples: Some(55), ..all }).1, [6, 7, 8, 9, 10]);
    assert_eq!(kept(Retention { bytes: Some(1), ..all }).1, [9, 10]);
}

#[test]
fn a_set_stays_while_one_that_known_loads_made_of_it_is_in_use() {
    let derived = |number: i64, from: &ModelSet| {
        let recalibrated = Recalibrated {
            derived_from: from.id.clone(),
            earlier: from.origins().map(str::to_owned).collect(),
            area_mm2: None,
            filled: None,
            gain: 1.1,
            gain_sigma: 0.01,
            offset_kpa: 0.0,
            offset_sigma_kpa: 0.0,
            place_rel: 0.03,
            relative_sigma: 0.03,
            gain_in_all: 1.1,
            points: Vec::new(),
        };
        Arc::new(with_id(ModelSet { recalibrated: Some(recalibrated), ..model_set(number) }))
    };
    let first = Arc::new(model_set(1));
    let second = derived(2, &first);
    let third = derived(3, &second);
    let idle = Arc::new(model_set(4));
    let restored = Restored {
        model_sets: [&first, &second, &third, &idle].map(|set| Arc::clone(set).into()).to_vec(),
        active: vec![(PATCH.to_owned(), third.id.clone())],
        ..Restored::default()
    };
    let none = Retention { model_sets: Some(0), ..Retention::default() };
    let gone = |restored: &Restored| {
        let id = |record: Record| match record {
            Record::ModelSetDeleted { model_set, .. } => model_set,
            other => panic!("{other:?}"),
        };
        sets_to_go(restored, &none).into_iter().map(id).collect::<Vec<_>>()
    };
    assert_eq!(gone(&restored), std::slice::from_ref(&idle.id));
    let judged =
        SessionView { state: SessionState::Review, model_set: Some(idle.id.clone().into()), ..SessionView::default() };
    let waiting = Restored { sessions: vec![Arc::new(judged)], ..restored.clone() };
    assert_eq!(gone(&waiting), <Vec<String>>::new(), "an operator has yet to judge it");
    let session = |number: u64, set: &Arc<ModelSet>, state: SessionState| {
        let (patch, model_set) = (PATCH.to_owned(), Some(set.id.clone().into()));
        Arc::new(SessionView { number, patch, state, model_set, ..SessionView::default() })
    };
    let sessions = vec![session(1, &idle, SessionState::Review), session(2, &third, SessionState::Active)];
    assert_eq!(gone(&Restored { sessions, ..restored.clone() }), std::slice::from_ref(&idle.id), "its time is over");
    let earlier = Restored { active: vec![(PATCH.to_owned(), first.id.clone())], ..restored };
    assert_eq!(gone(&earlier), [second.id.clone(), third.id.clone(), idle.id.clone()]);
}

#[test]
fn a_check_tells_what_there_is_and_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path);
    let whole = fs::read(&path).unwrap();
    let found = check(&path).unwrap();
    assert_eq!((found.model_sets, found.sessions, found.samples), (10, 10, 100));
    assert_eq!(found.damage, []);
    let mut damaged = whole.clone();
    damaged[20] ^= 0xff; // within the header
    fs::write(&path, &damaged).unwrap();
    let found = check(&path).unwrap();
    assert_eq!(found.damage.len(), 1, "{found:?}");
    assert!(fs::read(&path).unwrap() == damaged);
    let names: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "the store, its plain file and its lock: {names:?}");
    fs::write(&path, whole).unwrap();
    let (_store, ..) = open(&path);
    assert_eq!(check(&path).unwrap_err(), StoreError::InUse { path: path.clone() });
    assert_eq!(compact(&path).unwrap_err(), StoreError::InUse { path });
}

/// A file that was ours and lost what shows it, one that never was, and what is no file.
#[test]
fn a_check_tells_a_damaged_store_from_what_is_none() {
    let dir = tempfile::tempdir().unwrap();
    let [path, text] = ["store.db", "text.db"].map(|name| dir.path().join(name));
    grown(&path);
    let mut bytes = fs::read(&path).unwrap();
    bytes[..16].fill(0);
    fs::write(&path, bytes).unwrap();
    let found = check(&path).unwrap();
    assert_eq!((found.damage.len(), found.damage[0].what.as_str()), (1, "the store"), "{found:?}");
    fs::write(&text, "nothing of the kind ".repeat(100)).unwrap();
    assert!(matches!(check(&text).unwrap_err(), StoreError::Foreign { .. }));
    let refused = |path: &Path| {
        let compacted = compact(path).unwrap_err();
        assert_eq!(
            [check(path).unwrap_err(), StoreFile::open(path).err().unwrap()],
            [compacted.clone(), compacted.clone()]
        );
        assert_eq!(AuditFile::open(path).unwrap_err(), compacted);
        compacted.to_string()
    };
    assert!(refused(&dir.path().join("none.db")).contains("No such file"));
    assert!(refused(dir.path()).ends_with("cannot open the store: is no file"));
}

#[test]
fn compacting_gives_back_the_space_of_what_was_deleted() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    grown(&path);
    let few = Retention { model_sets: Some(1), sessions: Some(2), ..Retention::default() };
    let (store, ..) = Store::open_keeping(&path, &few, Box::new(|_| ())).unwrap();
    store.close().unwrap();
    let done = compact(&path).unwrap();
    assert!(done.after < done.before, "{done:?}");
    assert_eq!(check(&path).unwrap().damage, []);
}

/// Makes a store that has grown for years, for `tests/start.py`: 1,000 model sets of 230 taxels and 10,000 sessions.
#[test]
#[ignore = "takes minutes; the figures of a start need it"]
fn a_store_that_has_grown_for_years() {
    let Ok(path) = std::env::var("TAXEL_STORE_GROWN") else { return };
    let (store, ..) = open(Path::new(&path));
    let wide = |time: i64| {
        let mut set = model_set(time);
        set.taxels = set.taxels.iter().take(2).cycle().take(230).cloned().collect();
        set.baseline = set.baseline.iter().take(2).cycle().take(230).copied().collect();
        with_id(set)
    };
    for time in 1..=1000 {
        let mut records = vec![Record::ModelSet(Arc::new(wide(time)))];
        let sessions = 10 * (time as u64 - 1) + 1..=10 * time as u64;
        records.extend(sessions.map(|number| session(number, SessionState::Discarded)));
        write(&store, records).unwrap();
    }
    write(&store, vec![activated(&wide(1000))]).unwrap();
    store.close().unwrap();
}
