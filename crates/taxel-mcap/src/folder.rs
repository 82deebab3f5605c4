//! A folder of recordings within its budget: the oldest go first, and nothing goes that we did not write.

use std::collections::VecDeque;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use crate::name::FileName;

/// A folder of recordings, held by one process at a time.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    /// Oldest first, with their bytes.
    files: VecDeque<(FileName, u64)>,
    next: u32,
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
        let files = Self::list(path)?;
        let next = files.back().map_or(1, |(name, _)| name.number().saturating_add(1));
        Ok(Self { path: path.to_owned(), files, next, lock })
    }

    /// Its path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Counts the recordings that are there now: somebody may have removed some.
    ///
    /// # Errors
    /// The system's answer; those of before then count on.
    pub fn count_again(&mut self) -> io::Result<()> {
        self.files = Self::list(&self.path)?;
        Ok(())
    }

    /// The recordings of a folder, oldest first, with their bytes.
    ///
    /// # Errors
    /// The system's answer.
    pub fn list(path: &Path) -> io::Result<VecDeque<(FileName, u64)>> {
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
        Ok(files.into())
    }

    /// The path of the next file, which begins at so many nanoseconds since 1970.
    pub fn next_file(&mut self, wall_ns: i64) -> (FileName, PathBuf) {
        let name = FileName::new(self.next, wall_ns);
        self.next = self.next.saturating_add(1);
        let path = self.path_of(&name);
        (name, path)
    }

    /// The path of a file of this name.
    #[must_use]
    pub fn path_of(&self, name: &FileName) -> PathBuf {
        self.path.join(name.to_string())
    }

    /// A file is complete.
    pub fn add(&mut self, name: FileName, bytes: u64) {
        self.files.push_back((name, bytes));
    }

    /// Bytes of all complete files.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|(_, bytes)| bytes).sum()
    }

    /// Deletes the oldest files until all complete ones take at most so many bytes. Gives how many went.
    ///
    /// # Errors
    /// The system's answer; the file then counts on.
    pub fn keep(&mut self, bytes: u64) -> io::Result<usize> {
        let mut gone = 0;
        while self.bytes() > bytes {
            let Some((name, _)) = self.files.front() else { break };
            match fs::remove_file(self.path_of(name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => drop(self.files.pop_front()), // gone, by us or by somebody else
            }
            gone += 1;
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
    fn a_folder_is_free_again_though_a_process_that_is_being_started_has_a_copy_of_its_lock() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = Folder::open(scratch.path()).unwrap();
        let copy = folder.lock.try_clone().unwrap();
        assert!(Folder::open(scratch.path()).unwrap_err().to_string().contains("another process"));
        drop(folder);
        assert!(Folder::open(scratch.path()).is_ok());
        drop(copy);
    }

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
        let mut folder = Folder::open(scratch.path()).unwrap();
        assert_eq!(folder.bytes(), 200);
        assert_eq!(folder.next_file(0).0, FileName::new(5, 0));
        assert_eq!(folder.keep(150).unwrap(), 1);
        assert!(!at(&old).exists() && at(&newer).exists());
        assert_eq!(folder.keep(0).unwrap(), 1);
        assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 4, "what is not ours is still there");
        assert_eq!(folder.bytes(), 0);
    }

    #[test]
    fn one_process_at_a_time_records_into_a_folder() {
        let scratch = tempfile::tempdir().unwrap();
        let folder = Folder::open(scratch.path()).unwrap();
        let second = Folder::open(scratch.path()).unwrap_err().to_string();
        assert!(second.contains("another process records"), "{second}");
        drop(folder);
        Folder::open(scratch.path()).unwrap();
    }
}
