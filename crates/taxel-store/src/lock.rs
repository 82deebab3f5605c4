//! One process at a time has a store. Whoever starts takes this lock first: before that nothing is written, moved or removed.
//!
//! It is a lock on a small file of its own, which stays: the database may be replaced while the store is held, and of a
//! damaged one SQLite gives no lock. The file holds the number of the process that has the store.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::fcntl::{FcntlArg, fcntl};
use nix::libc;

use crate::error::StoreError;
use crate::files::{self, LOCK, beside};

/// How long to wait for a predecessor that is still closing the store, and how often to look.
pub(crate) const BUSY_TIMEOUT: Duration = Duration::from_secs(1);
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// Where SQLite locks a database (its file format, section 1.3.1): the lock-byte page.
const SQLITE_LOCKS: [i64; 2] = [0x4000_0000, 512];

/// The lock of a store, as long as this lives.
#[derive(Debug)]
pub(crate) struct StoreLock {
    file: File,
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
        let changing = |error: io::Error| StoreError::changing(&path, &error);
        let file = open(&path, database).map_err(changing)?;
        wait_until_free(database, || file.try_lock())?;
        Ok(Self { was_ours: files::length(&path) > 0, file })
    }

    /// Writes down which process has the store, and so that the store is ours. That it cannot be written keeps nobody from it.
    pub(crate) fn sign(&mut self) {
        let _ = self.file.set_len(0).and_then(|()| writeln!(self.file, "{}", std::process::id()));
    }
}

/// Refuses a store that another process has, and changes nothing.
///
/// # Errors
/// [`StoreError::InUse`].
pub(crate) fn refuse_in_use(database: &Path) -> Result<(), StoreError> {
    let file = File::open(beside(database, LOCK)).ok();
    wait_until_free(database, || file.as_ref().map_or(Ok(()), File::try_lock_shared))
}

fn wait_until_free(database: &Path, lock: impl Fn() -> Result<(), TryLockError>) -> Result<(), StoreError> {
    let until = Instant::now() + BUSY_TIMEOUT;
    loop {
        let holder = match lock() {
            Err(TryLockError::WouldBlock) => Some(signed(database)),
            Err(TryLockError::Error(error)) => return Err(StoreError::changing(&beside(database, LOCK), &error)),
            Ok(()) => locked_in_sqlite(database).map(Some),
        };
        match holder {
            None => return Ok(()),
            Some(process) if Instant::now() >= until => {
                return Err(StoreError::InUse { path: database.to_path_buf(), process });
            }
            Some(_) => std::thread::sleep(LOOK_AGAIN),
        }
    }
}

/// The process that signed the lock.
fn signed(database: &Path) -> Option<u32> {
    fs::read_to_string(beside(database, LOCK)).ok()?.trim().parse().ok()
}

/// Another process that has the database open in SQLite, which its lock tells.
fn locked_in_sqlite(database: &Path) -> Option<u32> {
    let is_file = fs::metadata(database).is_ok_and(|found| found.is_file()); // a pipe would be waited for
    let file = is_file.then(|| File::open(database).ok()).flatten()?;
    let [start, length] = SQLITE_LOCKS;
    let (kind, whence) = (libc::F_WRLCK as libc::c_short, libc::SEEK_SET as libc::c_short);
    let mut lock = libc::flock { l_type: kind, l_whence: whence, l_start: start, l_len: length, l_pid: 0 };
    fcntl(&file, FcntlArg::F_GETLK(&mut lock)).ok()?;
    (i32::from(lock.l_type) != libc::F_UNLCK).then(|| u32::try_from(lock.l_pid).unwrap_or(0))
}

/// Opens the file, and makes it if there is none. On a disk that takes nothing one that is there can be locked as well.
fn open(path: &PathBuf, database: &Path) -> io::Result<File> {
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(io::Error::other("is no regular file"));
    }
    let mut options = File::options();
    match options.read(true).write(true).create_new(true).mode(0o600).open(path) {
        Ok(file) => {
            files::give_to_owner_of(database, &file);
            Ok(file)
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => options.create_new(false).open(path),
        Err(error) => Err(error),
    }
}
