//! A store that no daemon has open is read where it lies.

use std::fs;

use rusqlite::Connection;

use super::audit::files;
use super::fixture::*;
use super::lost::copy;
use super::nothing_lost::killed;
use super::older::written_by;
use crate::schema;
use crate::{StoreError, StoreFile, beside};

#[test]
fn what_a_kill_left_is_read_and_nothing_is_changed() {
    let (work, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = work.path().join("store.db");
    let [_, second] = filled(&path);
    let (store, ..) = open(&path);
    write(&store, vec![sample_record(2, 40)]).unwrap();
    assert_eq!(StoreFile::open(&path).err().unwrap(), StoreError::InUse { path: path.clone() });
    copy(work.path(), killed.path());
    let path = killed.path().join("store.db");
    let before = files(killed.path());
    let file = StoreFile::open(&path).unwrap();
    assert_eq!(file.damage(), []);
    assert_eq!(file.restored().active, [(PATCH.to_owned(), second.id.clone())]);
    assert_eq!(file.samples(2).unwrap().samples, samples_of(&store, 2).unwrap().samples);
    assert_eq!(crate::models_json::from_json(&file.model_set(&second.id).unwrap()).unwrap().id, second.id);
    assert!(matches!(file.model_set("m-0").unwrap_err(), StoreError::NoModelSet { .. }));
    drop(file);
    assert_eq!(files(killed.path()), before);
}

/// The next start tells it and acts on it.
#[test]
fn what_is_lost_or_damaged_is_told_and_stays_as_it_is() {
    let (killed, path) = killed();
    fs::write(beside::wal(&path), []).unwrap();
    let before = files(killed.path());
    for time in ["first", "second"] {
        let file = StoreFile::open(&path).unwrap();
        let told: Vec<_> = file.damage().iter().map(ToString::to_string).collect();
        assert!(told.len() == 1 && told[0].contains("the write-ahead log"), "{time}: {told:?}");
    }
    assert_eq!(files(killed.path()), before);
    let mut bytes = fs::read(&path).unwrap();
    bytes[4096..8192].fill(0xFF);
    fs::write(&path, bytes).unwrap();
    let before = files(killed.path());
    assert!(StoreFile::open(&path).is_err());
    assert_eq!(files(killed.path()), before);
}

/// Somebody laid an old database beside the plain file of a newer one: active is what that says.
#[test]
fn what_the_plain_file_knows_better_is_read_and_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [first, _] = filled(&path);
    let old = fs::read(&path).unwrap();
    let (store, ..) = open(&path);
    write(&store, vec![activated(&first)]).unwrap();
    store.close().unwrap();
    fs::write(&path, old).unwrap();
    let file = StoreFile::open(&path).unwrap();
    assert_eq!(file.restored().active, [(PATCH.to_owned(), first.id.clone())]);
    assert!(file.damage()[0].to_string().contains("the list of activations"), "{:?}", file.damage());
    drop(file);
    fs::write(beside::active(&path), b"nothing of the kind").unwrap();
    assert_eq!(StoreFile::open(&path).unwrap().damage().len(), 1);
}

/// A paper or certificate names the set that the robot has its force by.
#[test]
fn what_a_start_takes_from_the_plain_file_beside_a_damaged_activation_is_read_as_well() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let [_, second] = filled(&path);
    let change = "DROP TRIGGER activations_keep; UPDATE activations SET patch = 'x' WHERE seq = 2";
    Connection::open(&path).unwrap().execute_batch(change).unwrap();
    let file = StoreFile::open(&path).unwrap();
    let active = [(PATCH.to_owned(), second.id)];
    assert_eq!(file.restored().active, active);
    let served = format!(
        "the activation of model set {}: the store has it no more, and the set is served from the plain file",
        active[0].1
    );
    assert!(file.damage().iter().any(|damage| damage.to_string() == served), "{:?}", file.damage());
    let (store, restored, quarantined, _events) = open(&path);
    assert_eq!((&restored.active[..], &quarantined[..]), (&active[..], file.damage()));
    store.close().unwrap();
}

#[test]
fn what_an_earlier_version_wrote_is_left_to_a_start() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    written_by(schema::STEPS.len() - 1, &path);
    let before = files(dir.path());
    let error = StoreFile::open(&path).err().unwrap().to_string();
    assert!(error.contains("an earlier version") && error.contains("store compact"), "{error}");
    assert_eq!(files(dir.path()), before);
    assert!(StoreFile::open(&dir.path().join("none.db")).is_err());
    assert!(!dir.path().join("none.db").exists());
}
