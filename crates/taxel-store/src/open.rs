//! A store is opened: what is damaged is set aside and the copy takes its place, and where nothing can be written what is
//! there is served as it is.

use std::path::Path;

use rusqlite::Connection;
use taxel_engine::Restored;

use crate::db::{Db, State};
use crate::error::{Quarantined, StoreError};
use crate::files::{self, COPY, LOG, beside};
use crate::lock::StoreLock;
use crate::restore::{self, Found};
use crate::{connect, copy, schema};

/// How findings name the file as a whole.
pub(crate) const STORE: &str = "the store";

/// What becomes of zeros when a start cannot know what was noted of them.
const ZEROS: &str = "every zero needs to be confirmed (`taxeld tare --confirmed-by NAME`)";

/// A store that is open, and what is to be told of it.
pub(crate) struct Opened {
    pub(crate) db: Db,
    pub(crate) restored: Restored,
    pub(crate) findings: Vec<Quarantined>,
}

/// Opens or creates a store.
///
/// # Errors
/// As [`Store::open`](crate::Store::open).
pub(crate) fn open(path: &Path) -> Result<Opened, StoreError> {
    let path = files::real(path);
    let mut opened = match StoreLock::take(&path).and_then(|lock| to_write(&path, lock)) {
        Err(error @ StoreError::Disk(_)) => to_read(&path, error)?,
        opened => opened?,
    };
    for finding in &opened.findings {
        tracing::error!(store = %path.display(), "{finding}");
    }
    opened.restored.problems = opened.findings.iter().map(ToString::to_string).collect();
    Ok(opened)
}

fn to_write(path: &Path, mut lock: StoreLock) -> Result<Opened, StoreError> {
    files::make_private(path);
    let mut findings = Vec::new();
    let copy = copy::read(path).unwrap_or_else(|error| {
        findings.push(Quarantined::new("the copy of the store", error));
        None
    });
    let was_ours = lock.was_ours || beside(path, COPY).exists();
    // Else nothing was ever here.
    let is_told = was_ours || files::length(path) > 0;
    let begun = read(path, was_ours, connect::to_write).and_then(|begun| unless_copy_is_better(begun, copy.as_ref()));
    let (connection, mut found) = match begun {
        Err(StoreError::Damaged(why)) => {
            let taken = take_copy(path, &why, copy.is_some())?;
            findings.extend(is_told.then_some(taken));
            read(path, true, connect::to_write)?
        }
        begun => begun?,
    };
    let needs_confirmation = found.open || found.zeros_damaged;
    tell(&mut found, &mut findings);
    let mut db = Db { connection, state: State::of(&found, path), lock: None };
    db.begin(path, needs_confirmation)?;
    lock.sign();
    db.lock = Some(lock);
    db.state.copy_due |= copy.is_none() && !found.restored.model_sets.is_empty();
    schema::give_back_space(&db.connection)?;
    db.state.fold_log(&db.connection)?;
    Ok(Opened { db, restored: found.restored, findings })
}

/// Opens a database and reads it. That it is open and its log is missing stays in [`Found::open`].
pub(crate) fn read(
    path: &Path,
    was_ours: bool,
    connect: fn(&Path) -> Result<Connection, StoreError>,
) -> Result<(Connection, Found), StoreError> {
    if path.exists() && !path.is_file() {
        return Err(StoreError::Foreign("it is no file".to_owned()));
    }
    if files::length(path) == 0 {
        return Err(StoreError::Damaged("it is missing or empty".to_owned()));
    }
    let without_log = !beside(path, LOG).exists();
    let read = connect(path).and_then(|connection| Ok((restore::read(&connection)?, connection)));
    let (mut found, connection) = read.map_err(|error| match error {
        // What is not recognized any more is damaged.
        StoreError::Foreign(why) if was_ours => StoreError::Damaged(why),
        other => other,
    })?;
    found.open &= without_log;
    Ok((connection, found))
}

/// Refuses a database that is older than its copy, or lacks a model set in use that this one has.
fn unless_copy_is_better<T>((file, found): (T, Found), copy: Option<&Found>) -> Result<(T, Found), StoreError> {
    match copy {
        Some(copy) if copy.generation > found.generation => Err(StoreError::Damaged(format!(
            "its newest commit is number {} and the copy has number {}: its write-ahead log was lost or torn",
            found.generation, copy.generation
        ))),
        Some(copy) if found.lacks_set && !copy.lacks_set => {
            let found: Vec<_> = found.damage.iter().map(ToString::to_string).collect();
            Err(StoreError::Damaged(found.join("; ")))
        }
        _ => Ok((file, found)),
    }
}

/// Sets aside what is there and has the copy take its place, or an empty store. Gives the words for it.
fn take_copy(path: &Path, why: &str, copy: bool) -> Result<Quarantined, StoreError> {
    let made = files::made(&beside(path, COPY));
    let aside = copy::take_its_place(path, copy)?;
    let kept = aside.map_or(String::new(), |aside| format!(", and kept as {}", aside.display()));
    let instead = if copy {
        format!("its copy of {made} is used instead: what was stored after that is missing, and {ZEROS}")
    } else {
        "there is no copy: the store starts EMPTY, and nothing is calibrated".to_owned()
    };
    Ok(Quarantined::lost(STORE, format!("{why}{kept}; {instead}")))
}

/// Adds what is to be told of a store that was read, and has its zeros confirmed where they may be old.
fn tell(found: &mut Found, findings: &mut Vec<Quarantined>) {
    if found.open {
        let why = format!(
            "its write-ahead log is missing, as after a copy of the main file alone: what was stored after commit {} is lost, \
             and {ZEROS}",
            found.generation
        );
        findings.push(Quarantined::lost(STORE, why));
    }
    if found.open || found.zeros_damaged {
        restore::require_confirmation(&mut found.restored);
    }
    findings.append(&mut found.damage);
}

/// Reads a store where it lies, or its copy if that is sound and the store is not. After `failure` nothing is changed.
fn to_read(path: &Path, failure: StoreError) -> Result<Opened, StoreError> {
    let lock = StoreLock::shared(path)?;
    let copy = copy::read(path).ok().flatten();
    if !path.exists() && copy.is_none() {
        return Err(failure);
    }
    let mut findings = Vec::new();
    let was_ours = lock.was_ours || copy.is_some();
    let begun = read(path, was_ours, connect::to_read).and_then(|begun| unless_copy_is_better(begun, copy.as_ref()));
    let (connection, mut found) = match (begun, copy) {
        (Err(error), Some(mut copy)) => {
            let path = beside(path, COPY);
            let why = format!("{error}; its copy of {} is served as it is, and {ZEROS}", files::made(&path));
            findings.push(Quarantined::lost(STORE, why));
            restore::require_confirmation(&mut copy.restored);
            (connect::to_read(&path)?, copy)
        }
        (begun, _) => begun?,
    };
    tell(&mut found, &mut findings);
    tracing::error!(error = %failure, "the store cannot be written: what is in it is served as it is");
    let state = State { failure: Some(failure), ..State::of(&found, path) };
    Ok(Opened { db: Db { connection, state, lock: Some(lock) }, restored: found.restored, findings })
}
