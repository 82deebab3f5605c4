//! What an operator does with a store that no daemon has open.

use std::fs;
use std::path::{Path, PathBuf};

use rusqlite::Connection;

use taxel_engine::audit::AuditEntry;

use crate::audit_rows;
use crate::beside;
use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::identity::{check_identity, is_damage};
use crate::in_place;
use crate::lock::refuse_in_use;
use crate::retention::Retention;
use crate::wal_check;

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Model sets that are sound.
    pub model_sets: usize,
    /// Sessions that are sound.
    pub sessions: usize,
    /// Samples that the sessions wrote.
    pub samples: u64,
    /// Bytes in use.
    pub bytes: u64,
    /// What is damaged.
    pub damage: Vec<Quarantined>,
}

/// Looks at a store and changes nothing: a copy beside it is opened, and removed again.
///
/// # Errors
/// [`StoreError`] if there is no store, a daemon has it, or it is not one of ours; not for damage.
pub fn check(path: &Path) -> Result<Checked, StoreError> {
    let path = &idle(path)?;
    let io = |error: std::io::Error| StoreError::Open { path: path.clone(), reason: error.to_string() };
    let mut damage = Vec::new();
    if let Some(reason) = wal_check::problem(path).map_err(io)? {
        damage.push(Quarantined::lost("the write-ahead log", reason));
    }
    let copy = beside::beside(path, "-check");
    let remove = || ["", "-wal"].iter().try_for_each(|suffix| beside::remove(&beside::beside(&copy, suffix)));
    remove().map_err(io)?;
    fs::copy(path, &copy).map_err(io)?;
    if beside::wal(path).exists() {
        fs::copy(beside::wal(path), beside::wal(&copy)).map_err(io)?;
    }
    let checked = match Db::open_file(&copy, true, None, &mut damage) {
        Ok((db, restored)) => db.size().map(|size| {
            let (model_sets, sessions) = (restored.model_sets.len(), restored.sessions.len());
            Checked { model_sets, sessions, samples: size.samples, bytes: size.bytes, damage }
        }),
        Err(StoreError::Damaged { findings, .. }) => {
            let way = "a start of the daemon, or `taxeld store compact`, puts what can be read of it into a new file and keeps this one";
            damage.push(Quarantined::new("the store", format!("{findings}; {way}")));
            Ok(Checked { damage, ..Checked::default() })
        }
        Err(error) if is_damage(&error, path) => {
            damage.push(Quarantined::new("the store", error));
            Ok(Checked { damage, ..Checked::default() })
        }
        Err(error) => Err(error),
    };
    remove().map_err(io)?;
    checked
}

/// What giving back space came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compacted {
    /// Bytes of the file before.
    pub before: u64,
    /// And after.
    pub after: u64,
    /// What is damaged.
    pub damage: Vec<Quarantined>,
}

/// Rewrites a store without its empty pages. A damaged one is put right as a start would.
///
/// # Errors
/// [`StoreError`] if there is no store, a daemon has it, or there is no room for the rewriting.
pub fn compact(path: &Path) -> Result<Compacted, StoreError> {
    let path = &file_of(path)?;
    let bytes = || fs::metadata(path).map(|file| file.len());
    let io = |error: std::io::Error| StoreError::Open { path: path.clone(), reason: error.to_string() };
    let before = bytes().map_err(io)?;
    let (db, _, damage) = Db::open_proving(path, &Retention::default(), u64::MAX)?;
    let db = db.writable()?;
    db.compact()?;
    db.close()?;
    Ok(Compacted { before, after: bytes().map_err(io)?, damage })
}

/// The audit log of a store that no daemon has open. Nothing of the store is changed: what is damaged is for the next start
/// to tell.
#[derive(Debug)]
pub struct AuditFile {
    connection: Connection,
    path: PathBuf,
}

impl AuditFile {
    /// Opens the store's files where they lie.
    ///
    /// # Errors
    /// [`StoreError`] if there is no store, a daemon has it, or it is not one of ours.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let path = idle(path)?;
        let connection = in_place::open(&path).map_err(|error| StoreError::opening(&path, &error))?;
        check_identity(&connection, &path)?;
        if !connection.table_exists(None, "audit").map_err(|error| StoreError::opening(&path, &error))? {
            return Err(StoreError::Foreign { path, reason: "it has no audit log".to_owned() });
        }
        Ok(Self { connection, path })
    }

    /// Entries with numbers below `number`, at most so many, newest first.
    ///
    /// # Errors
    /// [`StoreError`] if they cannot be read.
    pub fn before(&self, number: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        audit_rows::read(&self.connection, number, most).map_err(|error| StoreError::opening(&self.path, &error))
    }
}

/// The file itself of a store that no process has open.
///
/// # Errors
/// [`StoreError`] if there is none, or another process has it. What else is wrong with it shows later.
pub(crate) fn idle(path: &Path) -> Result<PathBuf, StoreError> {
    let path = file_of(path)?;
    refuse_in_use(&path)?;
    Ok(path)
}

/// The file itself. Opening what is not there would make it, and a device or a pipe would be written to, or be waited for.
fn file_of(path: &Path) -> Result<PathBuf, StoreError> {
    let path = beside::real(path);
    match fs::metadata(&path) {
        Ok(found) if found.is_file() => Ok(path),
        Ok(_) => Err(StoreError::Open { path, reason: "is no file".to_owned() }),
        Err(error) => Err(StoreError::Open { path, reason: error.to_string() }),
    }
}

/// Bytes of a store and its write-ahead log on the disk.
#[must_use]
pub fn size_on_disk(path: &Path) -> u64 {
    beside::bytes(&beside::real(path))
}
