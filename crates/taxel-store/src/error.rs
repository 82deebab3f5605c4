//! What can go wrong with a store, in words an operator can act on.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;
use thiserror::Error;

/// Why the store could not be opened, or could not write.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum StoreError {
    /// The file cannot be opened or created.
    #[error("{}: cannot open the store: {reason}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: String,
    },
    /// Another process has it.
    #[error(
        "{}: the store is in use by {}: stop that one, or give this one a store of its own (`store.path`)",
        path.display(),
        of_process(*process)
    )]
    InUse {
        /// The file.
        path: PathBuf,
        /// The process, if that is known.
        process: Option<u32>,
    },
    /// The file is not a store of this programme.
    #[error("{}: not a store of taxeld: {reason}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        reason: String,
    },
    /// The file was written by a newer version of this programme.
    #[error("{}: the store has schema version {found}, this programme knows versions up to {newest}", path.display())]
    TooNew {
        /// The file.
        path: PathBuf,
        /// The version found.
        found: i64,
        /// The newest version that is understood.
        newest: i64,
    },
    /// The file's structure is broken.
    #[error("{}: the store is damaged: {findings}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the check said.
        findings: String,
    },
    /// No space is left for it.
    #[error("no space is left for the store: {0}")]
    Full(String),
    /// Writing or reading failed.
    #[error("the store failed: {0}")]
    Io(String),
    /// The file was found damaged while it was open.
    #[error("the store's file is damaged: {0}")]
    Corrupt(String),
    /// A record that cannot be kept as it is.
    #[error("{what} cannot be stored: {reason}")]
    Unstorable {
        /// The record.
        what: String,
        /// What is wrong with it and what was expected.
        reason: String,
    },
    /// It was removed, replaced, emptied or cut while it was open: what is written into it is lost when it is closed.
    #[error("{}: it was {how} while it was open", path.display())]
    Replaced {
        /// The database or its log.
        path: PathBuf,
        /// What was done to it.
        how: String,
    },
    /// An earlier write failed, so that nothing more is written: what is on disk stays a prefix of what happened.
    #[error("the store takes no more writes until the programme is started again, because {reason}")]
    ReadOnly {
        /// The first failure.
        reason: String,
    },
    /// More waits for the disk than may.
    #[error("the store is behind: {waiting} batches wait for the disk")]
    Behind {
        /// How many wait.
        waiting: usize,
    },
    /// Samples on disk are not what was written.
    #[error("samples of session {session} are damaged on disk: {findings}")]
    DamagedSamples {
        /// Number of the session.
        session: u64,
        /// What is wrong with them.
        findings: String,
    },
    /// A model set on disk is not what was written.
    #[error("model set {model_set} is damaged on disk: {findings}")]
    DamagedModelSet {
        /// Its id.
        model_set: String,
        /// What is wrong with it.
        findings: String,
    },
    /// There is no such model set.
    #[error("there is no model set `{model_set}` in the store")]
    NoModelSet {
        /// The id that was asked for.
        model_set: String,
    },
    /// The writer's thread met a fault of this programme.
    #[error("the store's thread ended with an internal error")]
    Panicked,
    /// The writer has ended.
    #[error("the store is closed")]
    Closed,
}

impl StoreError {
    /// Sorts an error met while opening `path`.
    pub(crate) fn opening(path: &Path, error: &rusqlite::Error) -> Self {
        let path = path.to_path_buf();
        if error.sqlite_error().is_some_and(|error| error.extended_code == rusqlite::ffi::SQLITE_IOERR_SHORT_READ) {
            return Self::Damaged { path, findings: "it ends in the middle of a page".to_owned() };
        }
        match error.sqlite_error_code() {
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => Self::InUse { path, process: None },
            Some(ErrorCode::NotADatabase) => Self::Foreign { path, reason: "it is no SQLite file".to_owned() },
            Some(ErrorCode::DiskFull) => Self::Full(error.to_string()),
            Some(ErrorCode::ReadOnly) => Self::Io(error.to_string()),
            Some(ErrorCode::SystemIoFailure) if !is_of_reading(error) => Self::Io(error.to_string()),
            Some(
                ErrorCode::PermissionDenied
                | ErrorCode::CannotOpen
                | ErrorCode::OutOfMemory
                | ErrorCode::NoLargeFileSupport
                | ErrorCode::FileLockingProtocolFailed,
            ) => Self::Open { path, reason: error.to_string() },
            // Also what is read and is not of the type that was written, and what the disk does not give back.
            _ => Self::Damaged { path, findings: error.to_string().replace('\n', " ") },
        }
    }

    /// What became of changing a file.
    pub(crate) fn changing(path: &Path, error: &io::Error) -> Self {
        let words = format!("{}: {error}", path.display());
        match error.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::Full(words),
            _ => Self::Io(words),
        }
    }

    /// The same with more words.
    pub(crate) fn with(self, more: &str) -> Self {
        match self {
            Self::Full(said) => Self::Full(said + more),
            Self::Io(said) => Self::Io(said + more),
            other => other,
        }
    }

    /// The same with more words, if the file is damaged.
    pub(crate) fn with_corrupt(self, more: &str) -> Self {
        match self {
            Self::Corrupt(said) => Self::Corrupt(said + more),
            other => other,
        }
    }

    /// Whether a change failed for want of a disk that takes it; what was read before is as good as ever.
    pub(crate) fn is_of_changing(&self) -> bool {
        matches!(self, Self::Full(_) | Self::Io(_) | Self::Replaced { .. })
    }
}

/// Whether the disk did not give back what is on it. All other errors of input and output are those of changing files and of
/// locking them, and say nothing of what the files hold.
pub(crate) fn is_of_reading(error: &rusqlite::Error) -> bool {
    use rusqlite::ffi::{SQLITE_IOERR_CORRUPTFS, SQLITE_IOERR_DATA, SQLITE_IOERR_READ, SQLITE_IOERR_SHORT_READ};
    let of_reading = [SQLITE_IOERR_READ, SQLITE_IOERR_SHORT_READ, SQLITE_IOERR_DATA, SQLITE_IOERR_CORRUPTFS];
    error.sqlite_error().is_some_and(|error| of_reading.contains(&error.extended_code))
}

fn of_process(process: Option<u32>) -> String {
    process.map_or("another process".to_owned(), |process| format!("process {process}"))
}

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        match error.sqlite_error_code() {
            Some(ErrorCode::DiskFull) => Self::Full(error.to_string()),
            Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => Self::Corrupt(error.to_string()),
            Some(ErrorCode::SystemIoFailure) if is_of_reading(&error) => Self::Corrupt(error.to_string()),
            // The database itself is open.
            Some(ErrorCode::CannotOpen) => Self::Io(format!("{error} (is the disk full or read-only?)")),
            _ => Self::Io(error.to_string()),
        }
    }
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
    pub(crate) fn lost(what: impl Into<String>, reason: impl fmt::Display) -> Self {
        Self { what: what.into(), reason: reason.to_string() }
    }
}

/// So many findings are told in full, and so many characters of each: a disk that dies leaves thousands.
const LINES_MAX: usize = 20;
const LINE_CHARS_MAX: usize = 300;

/// A line for each finding, and one for those beyond the first twenty.
pub(crate) fn lines(findings: &[Quarantined]) -> Vec<String> {
    let line = |finding: &Quarantined| {
        finding.to_string().replace(['\n', '\r'], " ").chars().take(LINE_CHARS_MAX).collect::<String>()
    };
    let more = findings.len().saturating_sub(LINES_MAX);
    let rest =
        (more > 0).then(|| format!("{more} more rows of the store are damaged and not used; the log names them"));
    findings.iter().take(LINES_MAX).map(line).chain(rest).collect()
}

impl fmt::Display for Quarantined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.reason)
    }
}
