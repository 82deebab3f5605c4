//! What a recorder is at, for whoever asks.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a recorder is at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Why it does not record; `None` if it does.
    pub problem: Option<String>,
    /// The file that is written, or was last.
    pub file: String,
    /// Bytes of all recordings in the folder.
    pub bytes: u64,
    /// Frames and messages that are not in the recording.
    pub lost: u64,
}

/// A status that two threads share. Only its fields are read and written while it is locked.
#[derive(Debug, Default)]
pub(crate) struct Shared(Mutex<Status>);

impl Shared {
    pub(crate) fn get(&self) -> MutexGuard<'_, Status> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
