//! A store is opened: what is damaged is set aside and the copy takes its place, and where nothing can be written what is
//! there is served as it is.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rusqlite::Connection;
use taxel_engine::Restored;
use taxel_engine::record::Record;

use crate::db::{Db, State};
use crate::error::{Quarantined, StoreError, lines};
use crate::files::{self, COPY, LOG, beside};
use crate::lock::{StoreLock, refuse_in_use};
use crate::restore::{self, Found};
use crate::retention::{self, Retention};
use crate::watch::Watch;
use crate::{connect, copy, schema, sets};

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

/// Opens or creates a store, and deletes what is beyond the limits.
///
/// # Errors
/// As [`Store::open`](crate::Store::open).
pub(crate) fn open(path: &Path, limits: &Retention) -> Result<Opened, StoreError> {
    let path = files::real(path);
    let mut opened = match StoreLock::take(&path).and_then(|lock| to_write(&path, limits, lock)) {
        Err(error) if error.is_of_changing() => to_read(&path, error)?,
        opened => opened?,
    };
    for finding in &opened.findings {
        tracing::error!(store = %path.display(), "{finding}");
    }
    opened.restored.problems = lines(&opened.findings);
    Ok(opened)
}

fn to_write(path: &Path, limits: &Retention, mut lock: StoreLock) -> Result<Opened, StoreError> {
    files::make_private(path);
    let mut findings = Vec::new();
    let copy = copy::read(path).unwrap_or_else(|error| {
        findings.push(Quarantined::new("the copy of the store", error));
        None
    });
    let was_ours = lock.was_ours || beside(path, COPY).exists();
    let (connection, mut found) = match begin(path, was_ours).and_then(|begun| newer_wins(begun, copy.as_ref(), path)) {
        Err(error) if is_damage(&error) => {
            take_copy(path, &error, copy.is_some(), was_ours, &mut findings)?;
            begin(path, true)?
        }
        begun => begun?,
    };
    let is_doubted = found.open || found.zeros_damaged;
    if found.open {
        findings.push(log_is_missing(&found));
    }
    if is_doubted {
        restore::doubt_zeros(&mut found.restored);
    }
    findings.append(&mut found.damage);
    let mut db = Db { connection, state: State::of(&found, path), lock: None };
    db.begin(is_doubted)?;
    db.state.watch = Some(Watch::of(path)?);
    lock.sign();
    db.lock = Some(lock);
    repair_active(&mut db, path, &mut found, copy.as_ref(), &mut findings)?;
    db.state.appender.copy_due |= copy.is_none() && !found.restored.model_sets.is_empty();
    retain(&mut db, &mut found.restored, limits)?;
    schema::give_back_space(&db.connection)?;
    db.state.fold_log(&db.connection)?;
    Ok(Opened { db, restored: found.restored, findings })
}

/// Opens a database and reads it. That it is open and its log is missing stays in [`Found::open`].
fn begin(path: &Path, was_ours: bool) -> Result<(Connection, Found), StoreError> {
    let damaged = |findings: &str| StoreError::Damaged { path: path.to_path_buf(), findings: findings.to_owned() };
    if !path.exists() {
        return Err(damaged("it is missing"));
    }
    if path.is_file() && files::length(path) == 0 {
        return Err(damaged("it is empty"));
    }
    if path.is_file() && !connect::has_header(path) {
        let reason = "it does not begin as an SQLite file does".to_owned();
        return Err(damage_of_ours(StoreError::Foreign { path: path.to_path_buf(), reason }, was_ours));
    }
    let without_log = !beside(path, LOG).exists();
    let open = || {
        let connection = connect::to_write(path)?;
        connect::check(&connection, path)?;
        schema::use_log(&connection, path)?;
        let found = restore::read(&connection)?;
        Ok((connection, found))
    };
    let (connection, mut found) = open().map_err(|error| match error {
        // As where the log cannot be made beside it: it may be read all the same.
        StoreError::Open { path, reason } => {
            StoreError::Io(format!("{}: {reason} (is the disk full or read-only?)", path.display()))
        }
        other => damage_of_ours(other, was_ours),
    })?;
    found.open &= without_log;
    Ok((connection, found))
}

/// What is not recognized any more is damaged if it was ours.
fn damage_of_ours(error: StoreError, was_ours: bool) -> StoreError {
    match error {
        StoreError::Foreign { path, reason } if was_ours => StoreError::Damaged { path, findings: reason },
        other => other,
    }
}

/// Refuses a database that is older than its copy.
fn newer_wins<T>((file, found): (T, Found), copy: Option<&Found>, path: &Path) -> Result<(T, Found), StoreError> {
    match copy {
        Some(copy) if copy.generation > found.generation => {
            let findings = format!(
                "its newest commit is number {} and the copy has number {}: its write-ahead log was lost or torn",
                found.generation, copy.generation
            );
            Err(StoreError::Damaged { path: path.to_path_buf(), findings })
        }
        _ => Ok((file, found)),
    }
}

fn is_damage(error: &StoreError) -> bool {
    matches!(error, StoreError::Damaged { .. } | StoreError::Corrupt(_))
}

fn findings_of(error: &StoreError) -> String {
    match error {
        StoreError::Damaged { findings, .. } | StoreError::Corrupt(findings) => findings.clone(),
        other => other.to_string(),
    }
}

/// Sets aside what is there and has the copy take its place, or an empty store.
fn take_copy(
    path: &Path,
    why: &StoreError,
    copy: bool,
    was_ours: bool,
    findings: &mut Vec<Quarantined>,
) -> Result<(), StoreError> {
    // Nothing was ever here.
    let is_first = !path.exists() && !was_ours && files::aside(path).next().is_none();
    let made = files::made(&beside(path, COPY));
    let aside = copy::take_its_place(path, copy)?;
    if is_first {
        return Ok(());
    }
    let kept = aside.map_or(String::new(), |aside| format!(", and kept as {}", aside.display()));
    let instead = if copy {
        format!("its copy of {made} is used instead: what was stored after that is missing, and {ZEROS}")
    } else {
        "there is no copy: the store starts EMPTY, and nothing is calibrated".to_owned()
    };
    findings.push(Quarantined::lost(STORE, format!("{}{kept}; {instead}", findings_of(why))));
    Ok(())
}

fn log_is_missing(found: &Found) -> Quarantined {
    let why = format!(
        "its write-ahead log is missing, as after a copy of the main file alone: what was stored after commit {} is lost, and \
         {ZEROS}",
        found.generation
    );
    Quarantined::lost(STORE, why)
}

/// Takes model sets in use that cannot be read from the copy.
fn repair_active(
    db: &mut Db,
    path: &Path,
    found: &mut Found,
    copy: Option<&Found>,
    findings: &mut Vec<Quarantined>,
) -> Result<(), StoreError> {
    let mut records = Vec::new();
    for (patch, set) in repaired(path, found, copy, findings) {
        restore::serve(&mut found.restored, Arc::clone(&set));
        records.push(Record::ModelSet(Arc::clone(&set)));
        records.push(Record::Activated { patch, model_set: set.id.clone(), wall_ns: retention::wall_ns() });
    }
    if records.is_empty() { Ok(()) } else { db.state.write(&db.connection, records.iter()).map(drop) }
}

/// The sets in use that only the copy has, by patch.
fn repaired(
    path: &Path,
    found: &Found,
    copy: Option<&Found>,
    findings: &mut Vec<Quarantined>,
) -> Vec<(String, Arc<taxel_engine::model_set::ModelSet>)> {
    let mut repaired = Vec::new();
    let from = copy.and_then(|copy| Some((copy, copy::open(&beside(path, COPY)).ok()?)));
    for (patch, id) in &found.without_set {
        let wanted: Vec<(String, String)> = match (patch, copy) {
            (Some(patch), _) => vec![(patch.clone(), id.clone())],
            (None, Some(copy)) => copy.restored.active.clone(),
            (None, None) => Vec::new(),
        };
        for (patch, id) in wanted {
            if found.restored.active.iter().any(|(served, _)| *served == patch) {
                continue;
            }
            let set = from.as_ref().and_then(|(_, from)| sets::read(from, &id).ok()?.ok());
            let what = format!("the model set in use on patch `{patch}`");
            match set.filter(|set| set.patch == patch) {
                Some(set) => {
                    findings.push(Quarantined::lost(what, format!("{id} was taken from the copy")));
                    repaired.push((patch, Arc::new(set)));
                }
                None => findings.push(Quarantined::lost(what, format!("{id} cannot be read: none is in use"))),
            }
        }
    }
    repaired
}

/// Deletes what is beyond the limits.
fn retain(db: &mut Db, restored: &mut Restored, limits: &Retention) -> Result<(), StoreError> {
    for set in retention::sets_to_go(restored, limits) {
        db.state.write(&db.connection, [&set].into_iter())?;
        let Record::ModelSetDeleted { model_set, .. } = set else { continue };
        tracing::info!(model_set, "deleted: more model sets than are to be kept");
        restored.model_sets.retain(|set| set.id != model_set);
    }
    while let Some(record) = retention::session_to_go(restored, db.state.size(&db.connection)?, limits) {
        db.state.write(&db.connection, [&record].into_iter())?;
        let Record::SessionDeleted { session, .. } = record else { break };
        tracing::info!(session, "deleted: more sessions than are to be kept");
        restored.sessions.retain(|view| view.number != session);
    }
    Ok(())
}

/// Reads a store where it lies, or its copy if that is sound and the store is not. After `failure` nothing is changed.
fn to_read(path: &Path, failure: StoreError) -> Result<Opened, StoreError> {
    refuse_in_use(path)?;
    if !path.exists() && !beside(path, COPY).exists() {
        return Err(failure);
    }
    let copy = copy::read(path).ok().flatten();
    let was_ours = copy.is_some() || files::length(&beside(path, files::LOCK)) > 0;
    let (connection, mut found, mut findings) =
        match read_in_place(path, was_ours).and_then(|begun| newer_wins(begun, copy.as_ref(), path)) {
            Ok((connection, found)) if found.open => {
                let finding = log_is_missing(&found);
                (connection, found, vec![finding])
            }
            Ok((connection, found)) => (connection, found, Vec::new()),
            Err(error) => {
                let Some(found) = copy else { return Err(error) };
                let made = files::made(&beside(path, COPY));
                let why = format!("{}; its copy of {made} is served as it is", findings_of(&error));
                (copy::open(&beside(path, COPY))?, found, vec![Quarantined::lost(STORE, why)])
            }
        };
    if !findings.is_empty() || found.zeros_damaged {
        restore::doubt_zeros(&mut found.restored);
    }
    findings.append(&mut found.damage);
    tracing::error!(error = %failure, "the store cannot be written: what is in it is served as it is");
    let mut state = State::of(&found, path);
    state.failure = Some(failure);
    Ok(Opened { db: Db { connection, state, lock: None }, restored: found.restored, findings })
}

/// Reads a database where it lies. That it is open and its log is missing stays in [`Found::open`].
pub(crate) fn read_in_place(path: &Path, was_ours: bool) -> Result<(Connection, Found), StoreError> {
    let open = || {
        let connection = connect::to_read(path)?;
        connect::check(&connection, path)?;
        let found = restore::read(&connection)?;
        Ok((connection, found))
    };
    let (connection, mut found) = open().map_err(|error| damage_of_ours(error, was_ours))?;
    found.open &= !beside(path, LOG).exists();
    Ok((connection, found))
}

/// The file of a store that no process has open.
///
/// # Errors
/// [`StoreError`] if there is none, or another process has it.
pub(crate) fn idle(path: &Path) -> Result<PathBuf, StoreError> {
    let path = files::real(path);
    if !path.is_file() {
        let reason = if path.exists() { "is no file" } else { "there is none" };
        return Err(StoreError::Open { path, reason: reason.to_owned() });
    }
    refuse_in_use(&path)?;
    Ok(path)
}
