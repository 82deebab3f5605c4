//! Why a log cannot be read.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::log_format::ForeignLog;

/// The log cannot be opened, or not be read on.
#[derive(Debug, Error)]
pub enum LogFault {
    /// The file cannot be opened.
    #[error("{}: {error}", path.display())]
    Open {
        /// The log.
        path: PathBuf,
        /// The system's answer.
        error: io::Error,
    },
    /// Reading or unpacking failed. All complete lines before were handed out; of a damaged gzip those lack that were
    /// unpacked together with the damage, at most a block.
    #[error("{name}: after line {line}: {error}")]
    Read {
        /// The log.
        name: String,
        /// The last complete line, from 1.
        line: u64,
        /// The system's or the decoder's answer.
        error: io::Error,
    },
    /// Another program's log.
    #[error("{name}: {format}")]
    Foreign {
        /// The log.
        name: String,
        /// What it is, and how it becomes one that is read.
        format: ForeignLog,
    },
}
