//! One process at a time has a store. Whoever starts takes this lock first: before that, nothing beside the database is
//! written, moved or removed, and nothing that is seen there is believed.
//!
//! It is a lock on an empty file of its own, which stays. All other files may be replaced while the store is held, and SQLite
//! gives its own lock only to whoever opens the database and so changes its log; of a damaged database it gives none. Its lock
//! is looked at as well: earlier versions and other programs have that alone.

use std::fs::{self, File, TryLockError};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::fcntl::{FcntlArg, fcntl};
use nix::libc;

use crate::beside;
use crate::error::StoreError;
use crate::prepare::BUSY_TIMEOUT;

/// How long to wait before looking again whether a predecessor has closed the store.
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// Where SQLite locks a database (its file format, section 1.3.1): the lock-byte page.
const SQLITE_LOCKS: [i64; 2] = [0x4000_0000, 512];

/// The lock of a store, as long as this lives. It is to outlive the connection: see [`is_locked_by_sqlite`].
#[derive(Debug)]
pub(crate) struct StoreLock {
    _file: File,
}

impl StoreLock {
    /// Takes the lock of a database, which need not be there. Waits a second for a predecessor that is still closing it.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if another process has it. Any other error is why there can be no lock: then nothing may be
    /// changed.
    pub(crate) fn take(database: &Path) -> Result<Self, StoreError> {
        let path = beside::lock(database);
        let changing = |error: io::Error| StoreError::changing(&path, &error);
        let file = open(&path, database).map_err(changing)?;
        wait_until_free(database, || is_free(database, file.try_lock()).map_err(changing))?;
        Ok(Self { _file: file })
    }
}

/// Refuses a store that another process has, and changes nothing.
///
/// # Errors
/// [`StoreError::InUse`].
pub(crate) fn refuse_in_use(database: &Path) -> Result<(), StoreError> {
    let path = beside::lock(database);
    // Without such a file, or where it cannot be read, SQLite's lock has to do.
    let file = is_file(&path).then(|| File::open(&path).ok()).flatten();
    let look = || file.as_ref().map_or(Ok(()), File::try_lock_shared);
    wait_until_free(database, || Ok(is_free(database, look()).unwrap_or_else(|_| !is_locked_by_sqlite(database))))
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
pub(crate) fn file_of(path: &Path) -> Result<PathBuf, StoreError> {
    let path = beside::real(path);
    match fs::metadata(&path) {
        Ok(found) if found.is_file() => Ok(path),
        Ok(_) => Err(StoreError::Open { path, reason: "is no file".to_owned() }),
        Err(error) => Err(StoreError::Open { path, reason: error.to_string() }),
    }
}

/// What is wrong, unless a daemon has the store now: it has started meanwhile and changes the files under whoever reads them, which
/// looks like damage.
pub(crate) fn unless_in_use(path: &Path, error: StoreError) -> StoreError {
    refuse_in_use(path).err().unwrap_or(error)
}

fn wait_until_free(database: &Path, free: impl Fn() -> Result<bool, StoreError>) -> Result<(), StoreError> {
    let until = Instant::now() + BUSY_TIMEOUT;
    while !free()? {
        if Instant::now() >= until {
            return Err(StoreError::InUse { path: database.to_path_buf() });
        }
        std::thread::sleep(LOOK_AGAIN);
    }
    Ok(())
}

/// Whether nobody else has the store, by what came of locking our file and by SQLite's lock.
fn is_free(database: &Path, locked: Result<(), TryLockError>) -> io::Result<bool> {
    match locked {
        Ok(()) => Ok(!is_locked_by_sqlite(database)),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Opens the file, and makes it if there is none: for its owner alone, as the database, which is the database's also if root
/// makes it. On a disk that takes nothing one that is there can be locked as well.
fn open(path: &Path, database: &Path) -> io::Result<File> {
    if beside::is_no_file(path) {
        return Err(io::Error::other("is no regular file"));
    }
    let mut options = File::options();
    match options.read(true).write(true).create_new(true).mode(0o600).open(path) {
        Ok(file) => {
            beside::give_to_owner_of(database, &file);
            Ok(file)
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            options.create_new(false).open(path).or_else(|_| File::open(path))
        }
        Err(error) => Err(error),
    }
}

/// Whether it is a file: a pipe would be waited for.
fn is_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| found.is_file())
}

/// Whether another process has the database open in SQLite, which an exclusive or a shared lock tells.
///
/// Closing the file takes away all such locks that this process has on it: none, as whoever has a store in this process has
/// our lock.
fn is_locked_by_sqlite(database: &Path) -> bool {
    if !is_file(database) {
        return false;
    }
    let Ok(file) = File::open(database) else { return false };
    let [start, length] = SQLITE_LOCKS;
    let (kind, whence) = (libc::F_WRLCK as libc::c_short, libc::SEEK_SET as libc::c_short);
    let mut lock = libc::flock { l_type: kind, l_whence: whence, l_start: start, l_len: length, l_pid: 0 };
    let looked = fcntl(&file, FcntlArg::F_GETLK(&mut lock));
    looked.is_ok() && i32::from(lock.l_type) != libc::F_UNLCK
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;
    use std::process::Command;

    use super::*;

    #[test]
    fn a_store_has_one_lock_which_stays_as_a_file_of_its_owner_alone() {
        let dir = tempfile::tempdir().unwrap();
        let database = dir.path().join("store.db");
        let in_use = StoreError::InUse { path: database.clone() };
        refuse_in_use(&database).unwrap();
        assert!(!beside::lock(&database).exists(), "looking makes none");
        let lock = StoreLock::take(&database).unwrap();
        assert_eq!(StoreLock::take(&database).unwrap_err(), in_use);
        assert_eq!(refuse_in_use(&database).unwrap_err(), in_use);
        drop(lock);
        refuse_in_use(&database).unwrap();
        assert_eq!(fs::metadata(beside::lock(&database)).unwrap().mode() & 0o777, 0o600);
        drop(StoreLock::take(&database).unwrap());
    }

    #[test]
    fn a_predecessor_is_waited_for_and_not_for_ever() {
        let database = Path::new("store.db");
        let looks = std::cell::Cell::new(0);
        let free_after = |most| {
            looks.set(0);
            wait_until_free(database, || {
                looks.set(looks.get() + 1);
                Ok(looks.get() > most)
            })
        };
        free_after(3).unwrap();
        assert_eq!(looks.get(), 4);
        assert_eq!(free_after(u32::MAX).unwrap_err(), StoreError::InUse { path: database.to_owned() });
        assert!(looks.get() > 1);
    }

    #[test]
    fn what_is_no_file_is_named_and_not_waited_for() {
        for make in ["mkfifo", "mkdir"] {
            let dir = tempfile::tempdir().unwrap();
            let database = dir.path().join("store.db");
            for path in [beside::lock(&database), database.clone()] {
                assert!(Command::new(make).arg(path).status().unwrap().success());
            }
            let said = StoreLock::take(&database).unwrap_err();
            assert!(said.is_of_changing() && said.to_string().ends_with("store.db-lock: is no regular file"), "{said}");
            refuse_in_use(&database).unwrap();
        }
    }

    /// No process makes a file in this folder of the kernel's.
    #[test]
    fn why_no_lock_can_be_made_is_told_and_not_that_there_is_none() {
        let said = StoreLock::take(Path::new("/sys/store.db")).unwrap_err();
        assert!(said.is_of_changing() && !said.to_string().contains("No such file"), "{said}");
    }
}
