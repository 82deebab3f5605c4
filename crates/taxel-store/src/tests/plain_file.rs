//! The plain file of the active model sets is believed where it knows what the database has lost, and nowhere else.

use std::fs;
use std::path::{Path, PathBuf};

use rusqlite::Connection;
use taxel_engine::model_set::ModelSet;

use super::fixture::*;
use crate::db::Db;
use crate::{StoreError, active_file, beside, models_json};

/// A store of which the second of two sets is active.
fn scene() -> (tempfile::TempDir, PathBuf, [ModelSet; 2]) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("store.db");
    let sets = filled(&path);
    (dir, path, sets)
}

/// Puts a file there that says that this set was active under this id.
fn says(path: &Path, activation: u64, id: &str, set: &ModelSet) {
    let text = models_json::to_json(set).unwrap().into_bytes();
    active_file::keep(path, &active_file::content(activation, &[(id.to_owned(), text)]).unwrap()).unwrap();
}

#[test]
fn a_file_that_is_older_than_a_damaged_activation_serves_nothing() {
    let (_dir, path, [first, second]) = scene();
    let change = "DROP TRIGGER activations_keep; UPDATE activations SET patch = 'x' WHERE seq = 2";
    Connection::open(&path).unwrap().execute_batch(change).unwrap();
    says(&path, 1, &first.id, &first);
    let copy = tempfile::tempdir().unwrap();
    let as_new = copy.path().join("store.db");
    fs::copy(&path, &as_new).unwrap();
    let (db, restored, _) = Db::open(&path).unwrap();
    assert_eq!(restored.active, [], "nobody wants the first one any more");
    db.close().unwrap();
    says(&as_new, 2, &second.id, &second);
    let (_, restored, quarantined) = Db::open(&as_new).unwrap();
    assert_eq!(restored.active, [(PATCH.to_owned(), second.id)], "{quarantined:?}");
}

#[test]
fn a_set_that_lies_there_under_another_ones_name_is_not_served() {
    let (_dir, path, [first, second]) = scene();
    says(&path, 2, &second.id, &first);
    fs::remove_file(&path).unwrap();
    let (_, restored, quarantined) = Db::open(&path).unwrap();
    assert_eq!(restored.active, []);
    let said = format!("it names `{}`, its content is {}", second.id, first.id);
    assert!(quarantined.iter().any(|found| found.reason == said), "{quarantined:?}");
}

/// It is somebody's mistake, and not a store that was lost.
#[test]
fn a_folder_in_the_place_of_the_database_is_refused() {
    let (_dir, path, _) = scene();
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    let error = Db::open(&path).err().unwrap();
    assert!(matches!(error, StoreError::Open { .. }), "{error}");
    assert!(path.is_dir() && beside::active(&path).exists());
}
