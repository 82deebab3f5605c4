//! Whether the files that are open are still those that have the names. A file that is removed or replaced takes all that is
//! written, flushes and commits included, and loses it when it is closed.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::beside;
use crate::error::StoreError;

/// Device and inode.
type Identity = (u64, u64);

/// The database and its log as they were opened.
///
/// SQLite makes the log as it opens the database and shortens it without removing it, so that it is there until the
/// database is closed.
#[derive(Debug)]
pub(crate) struct HeldFiles([(PathBuf, Identity); 2]);

fn identity(path: &Path) -> io::Result<Identity> {
    fs::metadata(path).map(|file| (file.dev(), file.ino()))
}

impl HeldFiles {
    /// Those of a database that has just been opened.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] if one is not there any more.
    pub(crate) fn of(path: &Path) -> Result<Self, StoreError> {
        let held = |file: PathBuf| match identity(&file) {
            Ok(identity) => Ok((file, identity)),
            Err(_) => Err(StoreError::Replaced { path: file }),
        };
        Ok(Self([held(path.to_path_buf())?, held(beside::wal(path))?]))
    }

    /// Whether both are what they were.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] with the one that is not.
    pub(crate) fn check(&self) -> Result<(), StoreError> {
        let other = self.0.iter().find(|(file, held)| identity(file).ok() != Some(*held));
        other.map_or(Ok(()), |(file, _)| Err(StoreError::Replaced { path: file.clone() }))
    }
}
