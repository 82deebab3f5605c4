//! Whether the files that are open are still those that have the names, and the log as long as it was. A file that is removed or
//! replaced takes all that is written, flushes and commits included, and loses it when it is closed; what was cut off the log is
//! lost, and folding back what is left would break the database.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::error::StoreError;
use crate::{beside, open_mark, wal_check};

/// Device and inode.
type Identity = (u64, u64);

/// The database and its log as they were opened.
///
/// SQLite makes the log as it opens the database and shortens it without removing it, so that it is there until the
/// database is closed.
#[derive(Debug)]
pub(crate) struct HeldFiles {
    database: (PathBuf, Identity),
    log: (PathBuf, Identity),
    page_bytes: u64,
}

fn identity(path: &Path) -> io::Result<Identity> {
    fs::metadata(path).map(|file| (file.dev(), file.ino()))
}

impl HeldFiles {
    /// Those of a database that has just been opened, and has pages of this size.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] if one is not there any more.
    pub(crate) fn of(path: &Path, page_bytes: u64) -> Result<Self, StoreError> {
        let held = |file: PathBuf| match identity(&file) {
            Ok(identity) => Ok((file, identity)),
            Err(_) => Err(StoreError::Replaced { path: file }),
        };
        Ok(Self { database: held(path.to_path_buf())?, log: held(beside::wal(path))?, page_bytes })
    }

    /// Whether both are what they were, and all of the log is there that is known to be on disk.
    ///
    /// # Errors
    /// [`StoreError::Replaced`] with the one that is not, or [`StoreError::CutOff`].
    pub(crate) fn check(&self) -> Result<(), StoreError> {
        for (file, held) in [&self.database, &self.log] {
            if identity(file).ok() != Some(*held) {
                return Err(StoreError::Replaced { path: file.clone() });
            }
        }
        let log = &self.log.0;
        let expected = wal_check::bytes_of(open_mark::pages(&self.database.0), self.page_bytes);
        let bytes = fs::metadata(log).map_or(0, |file| file.len());
        if bytes < expected {
            return Err(StoreError::CutOff { path: log.clone(), bytes, expected });
        }
        Ok(())
    }

    /// Cuts off what the log has beyond so many pages, of which no commit was acknowledged.
    ///
    /// # Errors
    /// If it cannot be cut off, or the disk does not confirm it.
    pub(crate) fn cut_log(&self, pages: u32) -> io::Result<()> {
        let log = File::options().write(true).open(&self.log.0)?;
        log.set_len(wal_check::bytes_of(pages, self.page_bytes))?;
        log.sync_all()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_cut_back_to_its_last_commit() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        let log = beside::wal(&database);
        fs::write(&database, "").unwrap();
        fs::write(&log, [7; 20_000]).unwrap();
        let held = HeldFiles::of(&database, 4096).unwrap();
        for (pages, bytes) in [(2, 32 + 2 * (24 + 4096)), (0, 0)] {
            held.cut_log(pages).unwrap();
            assert_eq!(fs::metadata(&log).unwrap().len(), bytes);
        }
        fs::remove_file(&log).unwrap();
        assert_eq!(held.cut_log(0).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
