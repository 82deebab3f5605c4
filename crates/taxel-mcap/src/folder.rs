//! A folder of recordings within its budget: the oldest go first, and nothing goes that we did not write.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use crate::name::FileName;

/// A folder of recordings, held by one process at a time.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Keeps other processes out.
    lock: File,
}

impl Drop for Folder {
    /// To close the lock would not be enough: a process that another thread starts just now has a copy of it until it runs its
    /// own program, and keeps it locked.
    fn drop(&mut self) {
        let _ = self.lock.unlock(); // it fails where the system has lost the file, and the lock with that
    }
}

impl Folder {
    /// Opens a folder, and makes it if it is not there.
    ///
    /// # Errors
    /// The system's answer, or that another process records there.
    pub fn open(path: &Path) -> io::Result<Self> {
        fs::create_dir_all(path)?;
        let lock = File::open(path)?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => io::Error::other("another process records into this folder"),
            TryLockError::Error(error) => error,
        })?;
        Ok(Self { path: path.to_owned(), lock })
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The recordings of a folder, oldest first, with their bytes.
    ///
    /// # Errors
    /// The system's answer.
    pub fn list(path: &Path) -> io::Result<Vec<(FileName, u64)>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            let Some(name) = entry.file_name().to_str().and_then(FileName::parse) else { continue };
            // Not through links: what one points to is not ours.
            if let Ok(about) = entry.metadata()
                && about.is_file()
            {
                files.push((name, about.len()));
            }
        }
        files.sort();
        Ok(files)
    }

    /// The path of the next file, which begins at so many nanoseconds since 1970.
    ///
    /// # Errors
    /// The system's answer.
    pub fn next_file(&self, wall_ns: i64) -> io::Result<PathBuf> {
        let newest = Self::list(&self.path)?.last().map_or(0, |(name, _)| name.number());
        Ok(self.path.join(FileName::new(newest.saturating_add(1), wall_ns).to_string()))
    }

    /// Bytes of all recordings that are there now: somebody may have removed some.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        Self::list(&self.path).map_or(0, |files| files.iter().map(|(_, bytes)| bytes).sum())
    }

    /// Deletes the oldest files, but never the newest, until all take at most so many bytes. Gives how many went.
    ///
    /// # Errors
    /// The system's answer.
    pub fn keep(&self, bytes: u64) -> io::Result<usize> {
        let files = Self::list(&self.path)?;
        let mut left: u64 = files.iter().map(|(_, bytes)| bytes).sum();
        let mut gone = 0;
        for (name, bytes_of_it) in &files[..files.len().saturating_sub(1)] {
            if left <= bytes {
                break;
            }
            match fs::remove_file(self.path.join(name.to_string())) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => (left, gone) = (left - bytes_of_it, gone + 1), // gone, by us or by somebody else
            }
        }
        Ok(gone)
    }

    /// Bytes that are free on its disk for an account that is not root.
    ///
    /// # Errors
    /// The system's answer.
    pub fn free_bytes(&self) -> io::Result<u64> {
        let about = nix::sys::statvfs::statvfs(&self.path)?;
        Ok(about.blocks_available().saturating_mul(about.fragment_size()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_of_our_files_go_first_and_no_other_file_ever() {
        let scratch = tempfile::tempdir().unwrap();
        let at = |name: &str| scratch.path().join(name);
        let old = FileName::new(3, 2_000_000_000_000_000_000).to_string();
        let newer = FileName::new(4, 0).to_string(); // its clock said 1970
        for name in [&old, &newer, "notes.mcap", "taxeld-00000001-20261122T071402Z.mcap.gz"] {
            fs::write(at(name), [0; 100]).unwrap();
        }
        fs::create_dir(at("taxeld-00000002-20261122T071402Z.mcap")).unwrap();
        std::os::unix::fs::symlink(at("notes.mcap"), at("taxeld-00000001-20261122T071402Z.mcap")).unwrap();
        let folder = Folder::open(scratch.path()).unwrap();
        assert_eq!(folder.bytes(), 200);
        assert_eq!(folder.next_file(0).unwrap(), at(&FileName::new(5, 0).to_string()));
        assert_eq!((folder.keep(200).unwrap(), folder.keep(0).unwrap()), (0, 1));
        assert!(!at(&old).exists() && at(&newer).exists());
        assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 5, "what is not ours is still there");
        assert_eq!(folder.bytes(), 100);
    }

    /// Also where a process that is being started has a copy of the lock.
    #[test]
    fn one_process_at_a_time_records_into_a_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = Folder::open(scratch.path()).unwrap();
        let _copy = folder.lock.try_clone().unwrap();
        let second = Folder::open(scratch.path()).unwrap_err().to_string();
        assert!(second.contains("another process records"), "{second}");
        drop(folder);
        Folder::open(scratch.path()).unwrap();
    }
}
