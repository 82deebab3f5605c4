//! One process at a time has a store. A process that starts takes this lock first: before that nothing is written, moved or removed.
//!
//! It is a lock on a small file of its own, which stays: the database may be replaced while the store is held, and of a
//! damaged one SQLite gives no lock. The file holds the number of the process that has the store.

use std::fs::{self, File, TryLockError};
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::error::StoreError;
use crate::files::{self, LOCK, beside};

/// How long to wait for a predecessor that is still closing the store, and how often to look.
pub(crate) const BUSY_TIMEOUT: Duration = Duration::from_secs(1);
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// The lock of a store, as long as this lives.
#[derive(Debug)]
pub(crate) struct StoreLock {
    file: Option<File>,
    /// Whether a store of ours was here before: files that are not recognized are damaged then, and not somebody else's.
    pub(crate) was_ours: bool,
}

impl StoreLock {
    /// Takes the lock of a database, which need not be there.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if another process has it. Any other error is why there can be no lock: then nothing may be
    /// changed.
    pub(crate) fn take(database: &Path) -> Result<Self, StoreError> {
        let path = beside(database, LOCK);
        let mut options = File::options();
        let file = options.read(true).write(true).create(true).truncate(false).mode(0o600).open(&path);
        let file = file.map_err(|error| StoreError::of_file(&path, &error))?;
        files::give_to_owner_of(database, &file);
        wait_until_free(database, || file.try_lock())?;
        Ok(Self { was_ours: files::length(&path) > 0, file: Some(file) })
    }

    /// Keeps writers from a database that is read, and changes nothing.
    ///
    /// # Errors
    /// [`StoreError::InUse`].
    pub(crate) fn shared(database: &Path) -> Result<Self, StoreError> {
        let path = beside(database, LOCK);
        let file = File::open(&path).ok();
        wait_until_free(database, || file.as_ref().map_or(Ok(()), File::try_lock_shared))?;
        Ok(Self { was_ours: files::length(&path) > 0, file })
    }

    /// Writes down which process has the store, and so that the store is ours. That it cannot be written keeps nobody from it.
    pub(crate) fn sign(&mut self) {
        if let Some(file) = &mut self.file {
            let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
        }
    }
}

fn wait_until_free(database: &Path, lock: impl Fn() -> Result<(), TryLockError>) -> Result<(), StoreError> {
    let until = Instant::now() + BUSY_TIMEOUT;
    loop {
        match lock() {
            Ok(()) => return Ok(()),
            Err(TryLockError::Error(error)) => return Err(StoreError::of_file(&beside(database, LOCK), &error)),
            Err(TryLockError::WouldBlock) if Instant::now() >= until => {
                return Err(StoreError::InUse(signed(database)));
            }
            Err(TryLockError::WouldBlock) => std::thread::sleep(LOOK_AGAIN),
        }
    }
}

/// The process that signed the lock, if it lives: else somebody reads the store who does not sign.
fn signed(database: &Path) -> Option<u32> {
    let process: u32 = fs::read_to_string(beside(database, LOCK)).ok()?.trim().parse().ok()?;
    Path::new("/proc").join(process.to_string()).exists().then_some(process)
}
