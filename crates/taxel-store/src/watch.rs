//! Whether the files are still those that were opened: what is written into one that was removed, replaced, emptied or cut is
//! lost, and SQLite does not notice.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::error::StoreError;
use crate::files::{LOG, beside};

/// The files that are open, and how long they have to be.
#[derive(Debug)]
pub(crate) struct Watch {
    database: Watched,
    log: Watched,
}

#[derive(Debug)]
struct Watched {
    path: PathBuf,
    /// Device and number of the file.
    identity: (u64, u64),
    bytes: u64,
}

impl Watched {
    fn of(path: PathBuf) -> Result<Self, StoreError> {
        let found = fs::metadata(&path).map_err(|error| StoreError::of_file(&path, &error))?;
        Ok(Self { identity: (found.dev(), found.ino()), bytes: found.len(), path })
    }

    /// Its length now.
    fn check(&self) -> Result<u64, StoreError> {
        let bad = |how: &str| Err(StoreError::Disk(format!("{} was {how} while it was open", self.path.display())));
        match fs::metadata(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => bad("removed"),
            Err(error) => Err(StoreError::of_file(&self.path, &error)),
            Ok(found) if (found.dev(), found.ino()) != self.identity => bad("replaced"),
            Ok(found) if found.len() < self.bytes => bad(&format!("cut to {} bytes", found.len())),
            Ok(found) => Ok(found.len()),
        }
    }
}

impl Watch {
    /// Of a database that is open, with its log.
    pub(crate) fn of(path: &Path) -> Result<Self, StoreError> {
        Ok(Self { database: Watched::of(path.to_path_buf())?, log: Watched::of(beside(path, LOG))? })
    }

    /// Refuses to go on with files that are not those that were opened, or have lost something.
    pub(crate) fn check(&self) -> Result<(), StoreError> {
        self.database.check().and_then(|_| self.log.check()).map(drop)
    }

    /// After a commit, which has made the log longer.
    pub(crate) fn committed(&mut self) -> Result<(), StoreError> {
        self.database.check()?;
        self.log.bytes = self.log.check()?;
        Ok(())
    }

    /// After the log was folded back, which empties it.
    pub(crate) fn folded(&mut self) -> Result<(), StoreError> {
        self.log.bytes = 0;
        self.database.bytes = self.database.check()?;
        Ok(())
    }

    /// Cuts off what came after the last commit that succeeded.
    pub(crate) fn cut_log(&self) -> io::Result<()> {
        let log = File::options().write(true).open(&self.log.path)?;
        log.set_len(self.log.bytes)?;
        log.sync_all()
    }

    /// Bytes of the log.
    pub(crate) fn log_bytes(&self) -> u64 {
        self.log.bytes
    }
}
