//! What can go wrong with a store, in words an operator can act on.

use std::fmt;
use std::io;
use std::path::Path;

use rusqlite::ErrorCode;
use thiserror::Error;

/// Why the store could not be opened, or could not write. The caller names the file.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum StoreError {
    /// Another process has it; its number, if that is known.
    #[error("the store is in use by {}: stop that one, or give this one a store of its own (`store.path`)", of_process(*.0))]
    InUse(Option<u32>),
    /// The file is not a store of this programme.
    #[error("this is not a store of taxeld: {0}")]
    Foreign(String),
    /// The file was written by a newer version of this programme.
    #[error("the store has schema version {found}, this programme knows versions up to {newest}")]
    TooNew {
        /// The version found.
        found: i64,
        /// The newest version that is understood.
        newest: i64,
    },
    /// The file is not what was written.
    #[error("the store is damaged: {0}")]
    Damaged(String),
    /// The disk does not take or give it.
    #[error("the store failed: {0}")]
    Disk(String),
    /// A record that cannot be kept as it is.
    #[error("{what} cannot be stored: {reason}")]
    Unstorable {
        /// The record.
        what: String,
        /// What is wrong with it and what was expected.
        reason: String,
    },
    /// An earlier write failed, so that nothing more is written: what is on disk stays a prefix of what happened.
    #[error("the store takes no more writes until the programme is started again, because {0}")]
    ReadOnly(String),
    /// More waits for the disk than may.
    #[error("the store is behind: {waiting} batches wait for the disk")]
    Behind {
        /// How many wait.
        waiting: usize,
    },
    /// Samples of a session or a model set are not what was written.
    #[error("{0}")]
    DamagedRow(Quarantined),
    /// There is no model set of this id.
    #[error("there is no model set `{0}` in the store")]
    NoModelSet(String),
    /// The writer's thread met a fault of this programme.
    #[error("the store's thread ended with an internal error")]
    Panicked,
    /// The writer has ended.
    #[error("the store is closed")]
    Closed,
}

impl StoreError {
    /// What became of changing a file.
    pub(crate) fn of_file(path: &Path, error: &io::Error) -> Self {
        Self::Disk(format!("{}: {error}", path.display()))
    }
}

fn of_process(process: Option<u32>) -> String {
    process.map_or("another process".to_owned(), |process| format!("process {process}"))
}

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        let words = error.to_string().replace('\n', " ");
        match error.sqlite_error_code() {
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => Self::InUse(None),
            Some(ErrorCode::NotADatabase) => Self::Foreign("it is no SQLite file".to_owned()),
            Some(ErrorCode::SystemIoFailure) if is_of_reading(&error) => Self::Damaged(words),
            Some(ErrorCode::CannotOpen) => Self::Disk(format!("{words} (is the disk full or read-only?)")),
            Some(
                ErrorCode::DiskFull
                | ErrorCode::ReadOnly
                | ErrorCode::SystemIoFailure
                | ErrorCode::PermissionDenied
                | ErrorCode::OutOfMemory
                | ErrorCode::NoLargeFileSupport
                | ErrorCode::FileLockingProtocolFailed,
            ) => Self::Disk(words),
            // Also what is read and is not of the type that was written, and tables that are not ours.
            _ => Self::Damaged(words),
        }
    }
}

/// Whether the disk did not give back what is on it. All other errors of input and output are those of changing files and of
/// locking them, and say nothing of what the files hold.
fn is_of_reading(error: &rusqlite::Error) -> bool {
    use rusqlite::ffi::{SQLITE_IOERR_CORRUPTFS, SQLITE_IOERR_DATA, SQLITE_IOERR_READ, SQLITE_IOERR_SHORT_READ};
    let of_reading = [SQLITE_IOERR_READ, SQLITE_IOERR_SHORT_READ, SQLITE_IOERR_DATA, SQLITE_IOERR_CORRUPTFS];
    error.sqlite_error().is_some_and(|error| of_reading.contains(&error.extended_code))
}

/// Something on disk that is not what was written, or is not there any more. What is there is left where it is, reported, and
/// never served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantined {
    /// What it is, for example `model set m-0123456789abcdef`.
    pub what: String,
    /// Why it is not used, or what became of it.
    pub reason: String,
}

impl Quarantined {
    /// A row or a file that is not what was written.
    pub(crate) fn new(what: impl Into<String>, reason: impl fmt::Display) -> Self {
        Self::lost(what, format!("damaged on disk and not used: {reason}"))
    }

    /// What is not there, in whole or in part, or could not be used as it is: the reason says all of it.
    pub(crate) fn lost(what: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { what: what.into(), reason: reason.into() }
    }
}

impl fmt::Display for Quarantined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.reason)
    }
}
