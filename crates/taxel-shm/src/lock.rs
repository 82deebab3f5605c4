//! A file that one process has locked, and that is free at once when it gives it back.

use std::fs::{File, TryLockError};

/// A file that this process has locked.
#[derive(Debug)]
pub(crate) struct Lock(File);

impl Lock {
    /// Locks the file.
    ///
    /// # Errors
    /// That another process has it, or what the system says.
    pub(crate) fn take(file: File) -> Result<Self, TryLockError> {
        file.try_lock().map(|()| Self(file))
    }
}

impl Drop for Lock {
    /// To close the file would not be enough: a process that another thread starts just now has a copy of it until it runs its
    /// own program, and keeps the lock with that.
    fn drop(&mut self) {
        let _ = self.0.unlock(); // it fails where the system has lost the file, and the lock with that
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_free_again_though_a_process_that_is_being_started_has_a_copy_of_it() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let take = || Lock::take(File::open(file.path()).unwrap());
        let lock = take().unwrap();
        let copy = lock.0.try_clone().unwrap();
        assert!(matches!(take(), Err(TryLockError::WouldBlock)));
        drop(lock);
        assert!(take().is_ok());
        drop(copy);
    }
}
