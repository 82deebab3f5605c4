//! Files that are not what was written.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use rusqlite::Connection;
use taxel_engine::calibration::SessionState;
use taxel_engine::record::Record;

use super::fixture::*;
use crate::db::Db;
use crate::{StoreError, beside, schema};

/// Flips one bit of the only place in the file that holds `text`.
fn flip_in(path: &Path, text: &str) {
    let mut bytes = fs::read(path).unwrap();
    let places: Vec<_> =
        bytes.windows(text.len()).enumerate().filter(|(_, window)| *window == text.as_bytes()).collect();
    assert_eq!(places.len(), 1, "{text}");
    let at = places[0].0;
    bytes[at] ^= 1;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_flipped_bit_in_a_model_set_quarantines_it_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [first, second] = filled(&path);
    fs::remove_file(beside::active(&path)).unwrap();
    flip_in(&path, r#""created_wall_ns":2,"#);
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!(restored.model_sets.len(), 1);
    assert_eq!(restored.model_sets[0].id, first.id);
    assert_eq!(restored.active, [], "the older set does not become active by itself");
    let text: Vec<_> = quarantined.iter().map(ToString::to_string).collect();
    assert!(text[0].contains(&second.id) && text[0].contains("hash"), "{text:?}");
    assert!(text[1].contains(PATCH), "{text:?}");
    // The same set can be imported again, and is served again.
    write(&store, vec![Record::ModelSet(Arc::new(second.clone()))]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(restored.model_sets.len(), 2);
    assert_eq!(restored.active, [(PATCH.to_owned(), second.id)]);
    assert_eq!(quarantined.len(), 1, "the damaged row stays reported");
}

#[test]
fn a_damaged_activation_leaves_no_set_active() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    filled(&path);
    fs::remove_file(beside::active(&path)).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("DROP TRIGGER activations_keep; UPDATE activations SET patch = 'x' WHERE seq = 2").unwrap();
    drop(other);
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(restored.active, []);
    assert_eq!(restored.model_sets.len(), 2);
    assert!(quarantined[0].what.contains("activation 2"), "{quarantined:?}");
}

#[test]
fn rows_missing_at_the_end_are_noticed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [first, second] = filled(&path);
    fs::remove_file(beside::active(&path)).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("DROP TRIGGER activations_stay; DELETE FROM activations WHERE seq = 2").unwrap();
    other.execute_batch("DROP TRIGGER samples_stay; DELETE FROM samples WHERE idx = 39").unwrap();
    other.execute_batch("DROP TRIGGER sessions_stay; PRAGMA foreign_keys = OFF; DELETE FROM sessions").unwrap();
    drop(other);
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!(restored.active, [], "{} was replaced by {}", first.id, second.id);
    assert_eq!(restored.next_session, 3);
    let text = format!("{quarantined:?}");
    assert!(text.contains("2 were written, 1 are there") && text.contains("2 were written, 0 are there"), "{text}");
    // Choosing again cures it, although the gap stays reported.
    write(&store, vec![activated(&first)]).unwrap();
    store.close().unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(restored.active, [(PATCH.to_owned(), first.id)]);
    assert!(quarantined.iter().any(|damage| damage.what == "activation 2"), "{quarantined:?}");
}

#[test]
fn a_damaged_sample_fails_its_session_only() {
    for damage in [
        "UPDATE samples SET counts = x'00010203' WHERE idx = 7",
        "DELETE FROM samples WHERE idx = 7",
        "DELETE FROM samples WHERE idx = 39",
    ] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        let other = Connection::open(&path).unwrap();
        other.execute_batch(&format!("DROP TRIGGER samples_keep; DROP TRIGGER samples_stay; {damage}")).unwrap();
        drop(other);
        let (store, restored, quarantined, _events) = open(&path);
        assert_eq!(restored.sessions[1].state, SessionState::Failed);
        let (one, end) = ("sample 7", "40 were written, 39 are there");
        let reason = &restored.sessions[1].reason;
        assert!(reason.contains(one) || reason.contains(end), "{reason}");
        let refused = samples_of(&store, 2).unwrap_err().to_string();
        assert!(
            refused.contains("samples of session 2") && refused.contains(one) || refused.contains(end),
            "{refused}"
        );
        assert_eq!(quarantined.len(), 1);
        assert_eq!(quarantined[0].what, "samples of session 2");
        assert_eq!(restored.problems, [quarantined[0].to_string()]);
        assert_eq!((restored.model_sets.len(), restored.active.len(), restored.next_session), (2, 1, 3));
    }
}

#[test]
fn files_that_are_no_store_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let error = || Db::open(&path).err().unwrap();

    fs::write(&path, "# taxeld.toml\n".repeat(100)).unwrap();
    assert!(matches!(error(), StoreError::Foreign { .. }), "{}", error());
    fs::remove_file(&path).unwrap();

    Connection::open(&path).unwrap().execute_batch("CREATE TABLE t (x)").unwrap();
    assert!(error().to_string().contains("application id is 0x0"), "{}", error());
    fs::remove_file(&path).unwrap();

    filled(&path);
    let newer = schema::VERSION + 1;
    let later = Connection::open(&path).unwrap();
    later.pragma_update(None, "user_version", newer).unwrap();
    later.execute_batch("CREATE TABLE of_a_later_version (x)").unwrap(); // each version has tables of its own
    drop(later);
    assert_eq!(error(), StoreError::TooNew { path: path.clone(), found: newer, newest: schema::VERSION });

    let nowhere = dir.path().join("no/such/folder/store.db");
    assert!(Db::open(&nowhere).err().unwrap().to_string().contains("no/such/folder/store.db"));
}

#[test]
fn a_truncated_file_is_kept_aside_and_the_active_set_is_served() {
    let whole = {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        filled(&path);
        fs::read(&path).unwrap()
    };
    for length in [0, 2, 60, 100, 1000, 4096, whole.len() / 2, whole.len() - 4096, whole.len() - 1] {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        let [_, second] = filled(&path);
        fs::write(&path, &whole[..length]).unwrap();
        let (db, restored, quarantined) = Db::open(&path).unwrap_or_else(|error| panic!("{length} bytes: {error}"));
        assert_eq!(restored.active, [(PATCH.to_owned(), second.id.clone())], "{length} bytes");
        let told = format!("{quarantined:?}");
        assert!(told.contains("damaged-1"), "{length} bytes: {told}");
        db.close().unwrap();
        let aside = fs::read(dir.path().join("store.db.damaged-1")).unwrap();
        assert!(aside == whole[..length], "{length} bytes: what was damaged is kept as it was");
        // The next start finds a store that is whole.
        let (db, restored, _) = Db::open(&path).unwrap();
        assert_eq!(restored.active, [(PATCH.to_owned(), second.id)], "{length} bytes, again");
        assert!(!dir.path().join("store.db.damaged-2").exists());
        db.close().unwrap();
    }
}

#[test]
fn whatever_bit_flips_no_false_model_or_sample_is_served() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path).map(|set| format!("{set:?}"));
    let samples: Vec<_> = (0..40).map(sample).collect();
    let whole = fs::read(&path).unwrap();
    /// Prime, so that every place of a row is met.
    const STEP: usize = 41;
    let (mut opened, mut reported) = (0, 0);
    for at in (0..whole.len()).step_by(STEP) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        fs::write(&path, bytes).unwrap();
        let Ok((db, restored, quarantined)) = Db::open(&path) else {
            continue;
        };
        opened += 1;
        assert!(restored.active.iter().all(|(_, id)| sets[1].contains(id)), "byte {at} made a replaced set active");
        reported += usize::from(!quarantined.is_empty());
        for set in sets_in(&db, &restored) {
            assert!(sets.contains(&set), "byte {at} changed a model set");
        }
        if let Ok(found) = db.samples(2) {
            // Without the session's row there may be none at all, which is reported.
            assert!(found.samples == samples || !quarantined.is_empty(), "byte {at} changed a sample");
            assert!(found.samples.iter().all(|sample| samples.contains(sample)), "byte {at} changed a sample");
        }
        db.close().unwrap();
    }
    eprintln!("{opened} of {} opened, {reported} with something reported", whole.len().div_ceil(STEP));
    assert!(opened > 100 && reported > 50, "{opened} opened, {reported} with something reported");
}

#[test]
fn a_row_with_a_number_that_no_row_of_ours_has_keeps_no_store_from_opening() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [_, second] = filled(&path);
    let other = Connection::open(&path).unwrap();
    other.execute_batch("INSERT INTO model_sets SELECT -1, id, sha256, json FROM model_sets WHERE seq = 1").unwrap();
    drop(other);
    for damaged in [1, 0] {
        let (db, restored, quarantined) = Db::open(&path).unwrap();
        assert_eq!(restored.active, [(PATCH.to_owned(), second.id.clone())]);
        assert_eq!((restored.model_sets.len(), quarantined.len()), (2, damaged), "{quarantined:?}");
        db.close().unwrap();
    }
}
