//! Something that is no file has a name beside the database: nobody waits for it, and it is named.

use std::fs;
use std::os::unix::fs::symlink;
use std::process::Command;

use super::fixture::*;
use super::nothing_lost::killed;
use crate::db::Db;
use crate::{AuditFile, StoreFile, beside, check, files_of};

/// All names that the store gives, and SQLite.
const NAMES: [&str; 14] = [
    "-lock",
    "-wal",
    "-journal",
    "-shm",
    "-open",
    "-open-part",
    "-doubt",
    "-doubt-part",
    "-loss",
    "-loss-part",
    "-active",
    "-active-part",
    "-new",
    "-copy",
];

/// Neither a pipe nor what has no end holds anybody up, and the force goes on.
#[test]
fn what_is_no_file_beside_the_database_holds_nobody_up() {
    for name in NAMES {
        for make in ["mkfifo", "mkdir", "zero"] {
            let (_dir, path) = killed();
            let other = beside::beside(&path, name);
            beside::remove(&other).unwrap();
            match make {
                "zero" => symlink("/dev/zero", &other).unwrap(),
                make => assert!(Command::new(make).arg(&other).status().unwrap().success()),
            }
            let what = format!("{make} {name}");
            for (reader, error) in [
                ("read", StoreFile::open(&path).err()),
                ("audit", AuditFile::open(&path).err()),
                ("check", check(&path).err()),
            ] {
                let named = error.as_ref().is_none_or(|error| error.to_string().contains(name));
                assert!(named, "{what}, {reader}: {error:?}");
            }
            let (db, restored, quarantined) = Db::open(&path).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert_eq!(restored.active, [(PATCH.to_owned(), model_set(2).id)], "{what}");
            assert!(db.samples(2).unwrap().samples.len() >= 40, "{what}: {quarantined:?}");
        }
    }
}

/// Without a lock nothing is changed.
#[test]
fn the_mark_of_a_doubt_goes_with_the_start_that_proves_the_store() {
    let (_dir, path) = killed();
    beside::mark_doubt(&path);
    let (mark, lock) = (beside::doubt_mark(&path), beside::lock(&path));
    beside::remove(&lock).unwrap();
    fs::create_dir(&lock).unwrap();
    let (db, ..) = Db::open(&path).unwrap();
    assert!(db.writable().is_err() && mark.exists());
    fs::remove_dir(&lock).unwrap();
    let (db, ..) = Db::open(&path).unwrap();
    assert!(db.writable().is_ok() && !mark.exists());
}

/// A journal is another program's, or none: with the log, all is there.
#[test]
fn what_is_no_journal_is_put_aside_and_named() {
    for make in ["mkfifo", "mkdir"] {
        let (_dir, path) = killed();
        assert!(Command::new(make).arg(beside::journal(&path)).status().unwrap().success());
        let refused = StoreFile::open(&path).err().unwrap().to_string();
        assert!(refused.contains("store.db-journal: cannot open the store: it is in the way"), "{make}: {refused}");
        let (store, _, quarantined, _events) = open(&path);
        assert_eq!(quarantined.len(), 1, "{make}: {quarantined:?}");
        assert!(quarantined[0].to_string().contains("store.db-journal: it is no regular file"), "{quarantined:?}");
        assert_eq!(samples_of(&store, 2).unwrap().samples.len(), 43, "{make}");
        store.close().unwrap();
        assert!(fs::symlink_metadata(beside::beside(&path, ".damaged-1-journal")).is_ok(), "{make}");
    }
}

/// So that no other programme's output takes one of them.
#[test]
fn all_files_of_a_store_are_told() {
    let (dir, path) = killed();
    fs::write(beside::beside(&path, ".damaged-3-wal"), "kept").unwrap();
    let link = dir.path().join("link.db");
    symlink(&path, &link).unwrap();
    for store in [&path, &link] {
        let told = files_of(store);
        let real = beside::real(&path);
        assert!(NAMES.iter().all(|name| told.contains(&beside::beside(&real, name))), "{told:?}");
        let files = fs::read_dir(real.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path());
        let untold: Vec<_> = files.filter(|file| !told.contains(file) && !file.ends_with("link.db")).collect();
        assert!(untold.is_empty(), "{untold:?}");
    }
    fs::write(dir.path().join("other.db-wal"), "not ours").unwrap();
    assert!(!files_of(&path).contains(&beside::real(&dir.path().join("other.db-wal"))));
}
