//! What a start gives after something was done to the files: the set in use, from the file or from its copy, and words.
//!
//! `cargo test -p taxel-store --lib loss -- --nocapture` prints the table.

use std::os::unix::fs::FileExt;

use super::fixture::*;
use crate::files::{COPY, LOG, NEW, beside};
use crate::{Store, StoreError, check};

/// Where what a start serves comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum From {
    /// The file has all of it.
    File,
    /// The copy: what came after it is missing.
    Copy,
    /// Nothing is left.
    Nowhere,
}

/// A store whose second set is in use; session 2 has 40 samples that the copy lacks. Closed, or as a kill leaves it.
fn scene(closed: bool) -> (TempDir, PathBuf, String) {
    let (dir, path) = place();
    let [_, second] = filled(&path);
    if closed {
        return (dir, path, second.id);
    }
    // Killed after the copy was made anew: the log has what the file lacks, and one sample that the copy lacks as well.
    let (store, ..) = open(&path);
    write(&store, vec![session(3, SessionState::Aborted)]).unwrap();
    samples_of(&store, 3).unwrap();
    write(&store, vec![sample_record(2, 40)]).unwrap();
    let killed = tempfile::tempdir().unwrap();
    for name in ["store.db", "store.db-wal", "store.db-copy", "store.db-lock"] {
        fs::copy(dir.path().join(name), killed.path().join(name)).unwrap();
    }
    let path = killed.path().join("store.db");
    (killed, path, second.id)
}

/// Does something to the files and starts: once as told, and a second time without a word.
fn started(closed: bool, what: &str, change: impl Fn(&Path), from: From) {
    let (_dir, path, second) = scene(closed);
    change(&path);
    let (store, restored, found, _events) = open(&path);
    println!("| {what} | {} |", found.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "));
    let active = [(PATCH.to_owned(), second.clone())];
    assert_eq!(restored.active, if from == From::Nowhere { &active[..0] } else { &active }, "{what}: {found:?}");
    let samples = samples_of(&store, 2).unwrap().samples.len();
    let all = if closed { 40 } else { 41 };
    match from {
        From::File => assert_eq!(samples, all, "{what}"),
        From::Copy => assert!(samples < all, "{what}"),
        From::Nowhere => assert!(restored.model_sets.is_empty(), "{what}"),
    }
    if from != From::File {
        assert!(!found.is_empty() && !restored.problems.is_empty(), "{what} is not told");
        assert_eq!(needs_confirmation(&restored), from == From::Copy, "{what}: {:?}", restored.zeros);
    }
    // It takes new ones, and the next start says nothing and believes no zero either.
    write(&store, vec![session(9, SessionState::Aborted)]).unwrap();
    store.close().unwrap();
    let (store, again, found, _events) = open(&path);
    assert_eq!((again.active, found), (restored.active, vec![]), "{what}, again");
    assert_eq!(again.zeros, restored.zeros, "{what}, again");
    assert!(!beside(&path, NEW).exists());
    store.close().unwrap();
}

fn overwrite(path: &Path, at: u64, bytes: &[u8]) {
    File::options().write(true).open(path).unwrap().write_all_at(bytes, at).unwrap();
}

fn cut(path: &Path, numerator: u64, denominator: u64) {
    let file = File::options().write(true).open(path).unwrap();
    file.set_len(file.metadata().unwrap().len() * numerator / denominator).unwrap();
}

/// Changes rows as only another program would, or a flipped bit.
fn change_rows(path: &Path, sql: &str) {
    Connection::open(path).unwrap().execute_batch(sql).unwrap();
}

#[test]
fn a_damaged_file_is_set_aside_and_its_copy_takes_its_place() {
    type Change = fn(&Path);
    let cases: [(&str, Change); 9] = [
        ("removed", |path| fs::remove_file(path).unwrap()),
        ("emptied", |path| fs::write(path, []).unwrap()),
        ("cut to half of it", |path| cut(path, 1, 2)),
        ("its last page cut off", |path| {
            let file = File::options().write(true).open(path).unwrap();
            file.set_len(file.metadata().unwrap().len() - 4096).unwrap();
        }),
        ("its header overwritten", |path| overwrite(path, 0, &[0xFF; 64])),
        ("its application id flipped", |path| overwrite(path, 68, &[0x75])),
        ("a page in the middle overwritten", |path| overwrite(path, 4096, &[0xFF; 4096])),
        ("replaced by a text", |path| fs::write(path, "not a database").unwrap()),
        ("replaced by another database", |path| {
            fs::remove_file(path).unwrap();
            change_rows(path, "CREATE TABLE other (a); INSERT INTO other VALUES (1)");
        }),
    ];
    for (what, change) in cases {
        started(true, what, change, From::Copy);
    }
    let (_dir, path, _) = scene(true);
    overwrite(&path, 4096, &[0xFF; 4096]);
    let damaged = fs::read(&path).unwrap();
    drop(open(&path));
    let files = fs::read_dir(path.parent().unwrap()).unwrap().map(|file| file.unwrap().path());
    let kept: Vec<_> = files.filter(|file| file.to_string_lossy().contains(".damaged-20")).collect();
    assert!(kept.iter().any(|file| fs::read(file).unwrap() == damaged), "{kept:?}");
}

#[test]
fn a_lost_or_torn_log_is_told_by_the_number_of_commits_in_the_copy() {
    started(false, "killed, nothing done", |_| (), From::File);
    started(false, "the log removed", |path| fs::remove_file(beside(path, LOG)).unwrap(), From::Copy);
    started(false, "the log emptied", |path| fs::write(beside(path, LOG), []).unwrap(), From::Copy);
    started(false, "the log cut to a tenth", |path| cut(&beside(path, LOG), 1, 10), From::Copy);
    started(false, "the log's header overwritten", |path| overwrite(&beside(path, LOG), 0, &[0; 32]), From::Copy);
    started(
        false,
        "the file replaced by an earlier one of its own, without a log",
        |path| {
            let other = tempfile::tempdir().unwrap();
            filled(&other.path().join("store.db"));
            fs::copy(other.path().join("store.db"), path).unwrap();
            fs::remove_file(beside(path, LOG)).unwrap();
        },
        From::Copy,
    );
}

/// What `cp` makes of a running store if the log is forgotten. Found by attack: it started without a word.
#[test]
fn the_main_file_of_a_running_store_copied_alone_says_that_its_log_is_missing() {
    let (_dir, path) = place();
    let (store, ..) = open(&path);
    let set = Arc::new(model_set(1));
    write(&store, vec![Record::ModelSet(Arc::clone(&set)), zeros(None), session(1, SessionState::Review)]).unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let copied = elsewhere.path().join("store.db");
    fs::copy(&path, &copied).unwrap();
    let told = check(&copied).unwrap().damage;
    assert!(told.len() == 1 && told[0].reason.contains("log is missing"), "{told:?}");
    let (other, restored, found, _events) = open(&copied);
    assert!(found.len() == 1 && found[0].to_string().contains("copy of the main file alone"), "{found:?}");
    assert_eq!(restored.problems.len(), 1);
    other.close().unwrap();
    assert_eq!(open(&copied).2, [], "it was told");
    // With a set that was folded back its zero is not valid.
    write(&store, vec![activated(&set)]).unwrap();
    store.close().unwrap();
    let (_store, ..) = open(&path);
    fs::copy(&path, &copied).unwrap();
    let (_other, restored, found, _events) = open(&copied);
    assert_eq!((restored.active.len(), found.len(), needs_confirmation(&restored)), (1, 1, true));
}

#[test]
fn where_the_set_in_use_is_damaged_the_copy_takes_the_place_of_the_file() {
    for (what, sql) in [
        ("its text", "UPDATE facts SET body = body || ' ' WHERE kind = 'model set'"),
        ("which one it is", "UPDATE facts SET body = replace(body, 'm-', 'm_') WHERE kind = 'active'"),
        ("the patch on which it is", "UPDATE facts SET name = 'left_forearn' WHERE kind = 'active'"),
    ] {
        started(true, &format!("set in use: {what} changed"), |path| change_rows(path, sql), From::Copy);
    }
    // Without a copy all else is there.
    let (_dir, path, _) = scene(true);
    fs::remove_file(beside(&path, COPY)).unwrap();
    change_rows(&path, "UPDATE facts SET body = body || ' ' WHERE kind = 'model set'");
    let (store, restored, found, _events) = open(&path);
    assert_eq!((&*restored.active, restored.model_sets.len()), (&[][..], 2));
    assert!(found.len() == 1 && found[0].what == "the model set in use on patch `left_forearm`", "{found:?}");
    assert_eq!(samples_of(&store, 2).unwrap().samples.len(), 40);
}

#[test]
fn damaged_rows_are_told_and_left_out() {
    for (what, sql) in [
        (
            "session 1",
            "UPDATE facts SET body = replace(body, 'Active', 'Review') WHERE kind = 'session' AND number = 1",
        ),
        ("what was noted of the boards' zeros", "UPDATE facts SET body = '{}' WHERE kind = 'zeros'"),
        ("load 1", "UPDATE facts SET body = '{}' WHERE kind = 'load'"),
    ] {
        let (_dir, path, second) = scene(true);
        let (store, ..) = open(&path);
        write(&store, vec![load(1), zeros(Some("a load"))]).unwrap();
        store.close().unwrap();
        change_rows(&path, sql);
        let (_, restored, found, _events) = open(&path);
        println!("| {what} changed | {} |", found[0]);
        assert_eq!((found.len(), &*found[0].what), (1, what));
        assert_eq!(restored.active[0].1, second);
        assert!(needs_confirmation(&restored), "{what}: of its zeros only the worst counts");
    }
    // Samples are proven when they are read.
    let (_dir, path, _) = scene(true);
    change_rows(&path, "UPDATE samples SET block = zeroblob(length(block)) WHERE first = 0");
    let (store, ..) = open(&path);
    let refused = samples_of(&store, 2).unwrap_err();
    assert!(refused.to_string().starts_with("samples of session 2: damaged"), "{refused}");
    store.close().unwrap();
    let told = check(&path).unwrap().damage;
    assert!(told.len() == 1 && told[0].what == "samples of session 2", "{told:?}");
}

#[test]
fn a_damaged_copy_is_told_and_made_anew() {
    for change in [|path: &Path| overwrite(path, 4096, &[0xFF; 4096]), |path: &Path| fs::remove_file(path).unwrap()] {
        let (_dir, path, second) = scene(true);
        change(&beside(&path, COPY));
        let is_there = beside(&path, COPY).exists();
        let (store, restored, found, _events) = open(&path);
        assert_eq!(found.len(), usize::from(is_there), "{found:?}");
        assert_eq!(restored.active[0].1, second);
        write(&store, vec![asked(1)]).unwrap();
        store.close().unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!(open(&path).1.active[0].1, second, "the new copy");
    }
}

#[test]
fn without_a_copy_a_damaged_store_starts_empty_and_says_so() {
    started(
        true,
        "the file and its copy cut to half",
        |path| {
            cut(path, 1, 2);
            cut(&beside(path, COPY), 1, 2);
        },
        From::Nowhere,
    );
    let (_dir, path, _) = scene(true);
    fs::remove_file(beside(&path, COPY)).unwrap();
    cut(&path, 1, 2);
    let (_, restored, found, _events) = open(&path);
    assert!(found[0].reason.contains("starts EMPTY") && found[0].reason.contains(".damaged-"), "{found:?}");
    assert_eq!(restored.problems.len(), 1);
}

/// It may be somebody's.
#[test]
fn what_was_never_a_store_is_refused_and_left_as_it_is() {
    for (content, says) in [(None, "application id"), (Some("a letter"), "no SQLite file")] {
        let (_dir, path) = place();
        match content {
            Some(text) => fs::write(&path, text).unwrap(),
            None => change_rows(&path, "CREATE TABLE other (a)"),
        }
        let before = fs::read(&path).unwrap();
        for _ in 0..2 {
            let refused = Store::open(&path, Box::new(|_| ())).unwrap_err();
            assert!(matches!(refused, StoreError::Foreign(_)) && refused.to_string().contains(says), "{refused}");
        }
        assert_eq!(fs::read(&path).unwrap(), before);
    }
    let (_dir, path, _) = scene(true);
    change_rows(&path, "PRAGMA user_version = 7");
    let newer = Store::open(&path, Box::new(|_| ())).unwrap_err();
    assert_eq!(newer, StoreError::TooNew { found: 7, newest: 1 });
}

#[test]
fn what_happens_to_the_files_while_they_are_open_acknowledges_nothing() {
    type Change = fn(&Path);
    let cases: [(&str, Change); 6] = [
        ("removed", |path| fs::remove_file(path).unwrap()),
        ("replaced", |path| {
            fs::copy(path, beside(path, "2")).unwrap();
            fs::rename(beside(path, "2"), path).unwrap();
        }),
        ("cut to 0 bytes", |path| File::options().write(true).open(path).unwrap().set_len(0).unwrap()),
        ("removed", |path| fs::remove_file(beside(path, LOG)).unwrap()),
        ("cut to 0 bytes", |path| File::options().write(true).open(beside(path, LOG)).unwrap().set_len(0).unwrap()),
        ("replaced", |path| {
            fs::rename(beside(path, LOG), beside(path, "2")).unwrap();
            fs::copy(beside(path, "2"), beside(path, LOG)).unwrap();
        }),
    ];
    for (number, (how, change)) in cases.into_iter().enumerate() {
        let (_dir, path, second) = scene(true);
        let (store, ..) = open(&path);
        write(&store, vec![sample_record(2, 40)]).unwrap();
        change(&path);
        let refused = write(&store, vec![sample_record(2, 41)]).unwrap_err();
        assert!(refused.to_string().contains(&format!("was {how}")), "{number}: {refused}");
        let later = write(&store, vec![sample_record(2, 41)]).unwrap_err();
        assert!(matches!(later, StoreError::ReadOnly(_)), "{number}: {later}");
        assert_eq!(store.close(), Err(refused));
        assert_eq!(open(&path).1.active[0].1, second, "{number}");
    }
}
