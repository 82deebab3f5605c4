//! What an operator does with a store that no daemon has open.

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use rusqlite::Connection;

use taxel_engine::audit::AuditEntry;

use crate::audit_rows;
use crate::beside;
use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::identity::{check_identity, is_damage};
use crate::in_place;
use crate::lock::{file_of, idle, refuse_in_use, unless_in_use};
use crate::loss;
use crate::retention::Retention;
use crate::store_file::StoreFile;

/// What a store holds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Model sets that are sound.
    pub model_sets: usize,
    /// Sessions that are sound.
    pub sessions: usize,
    /// Samples that the sessions wrote.
    pub samples: u64,
    /// Bytes in use.
    pub bytes: u64,
    /// What is damaged.
    pub damage: Vec<Quarantined>,
}

/// Looks at a store, proves all of it, and changes nothing: it tells what the next start would.
///
/// # Errors
/// [`StoreError`] if there is no store, a daemon has it, or it is not one of ours; not for damage.
pub fn check(path: &Path) -> Result<Checked, StoreError> {
    let path = &idle(path)?;
    let mut lost = Vec::new();
    let read = match StoreFile::read(path, path, Some(StoreError::TooOld { path: path.clone() }), &mut lost) {
        Err(StoreError::TooOld { .. }) => {
            let copy = Copied::of(path).map_err(|error| open_error(path, &error))?;
            StoreFile::read(path, &copy.database(), None, &mut lost).and_then(StoreFile::prove_all)
        }
        read => read.and_then(StoreFile::prove_all),
    };
    let damaged = |finding| Checked { damage: [lost, vec![finding]].concat(), ..Checked::default() };
    match read {
        Ok((restored, size, damage)) => {
            let (model_sets, sessions) = (restored.model_sets.len(), restored.sessions.len());
            Ok(Checked { model_sets, sessions, samples: size.samples, bytes: size.bytes, damage })
        }
        Err(StoreError::Damaged { findings, .. }) => {
            let way = "a start of the daemon, or `taxeld store compact`, puts what can be read of it into a new file and keeps this one";
            Ok(damaged(Quarantined::lost("the store", format!("{findings}; {way}"))))
        }
        Err(error) if is_damage(&error, path) => Ok(damaged(Quarantined::lost("the store", error))),
        Err(error) => Err(error),
    }
}

/// So many checks may run at a time, or have been stopped without removing their copy.
const COPIES_MAX: u32 = 100;

/// A copy of a store of an earlier version, which can be read as one of this version once it is changed. It is not beside the store,
/// whose names are taken and whose disk may take nothing, and goes with this.
struct Copied(PathBuf);

impl Copied {
    fn of(path: &Path) -> io::Result<Self> {
        let copied = Self(private_folder(&std::env::temp_dir())?);
        beside::copy(path, &copied.database())?;
        if beside::wal(path).exists() {
            beside::copy(&beside::wal(path), &beside::wal(&copied.database()))?;
        }
        Ok(copied)
    }

    fn database(&self) -> PathBuf {
        self.0.join("store.db")
    }
}

/// A new folder among those for temporary files, which nobody else can open.
fn private_folder(temporary: &Path) -> io::Result<PathBuf> {
    for number in 1..=COPIES_MAX {
        let folder = temporary.join(format!("taxeld-store-check-{number}"));
        match DirBuilder::new().mode(0o700).create(&folder) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made.map(|()| folder),
        }
    }
    Err(io::Error::other(format!("{COPIES_MAX} copies of stores are in {}", temporary.display())))
}

impl Drop for Copied {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_dir_all(&self.0) {
            tracing::warn!(folder = %self.0.display(), %error, "a copy of a store could not be removed");
        }
    }
}

fn open_error(path: &Path, error: &io::Error) -> StoreError {
    StoreError::Open { path: path.to_path_buf(), reason: error.to_string() }
}

/// What giving back space came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compacted {
    /// Bytes of the file before.
    pub before: u64,
    /// And after.
    pub after: u64,
    /// What is damaged.
    pub damage: Vec<Quarantined>,
}

/// Rewrites a store without its empty pages. A damaged one is put right as a start would.
///
/// # Errors
/// [`StoreError`] if there is no store, a daemon has it, or there is no room for the rewriting.
pub fn compact(path: &Path) -> Result<Compacted, StoreError> {
    let path = &file_of(path)?;
    let bytes = || fs::metadata(path).map(|file| file.len());
    let before = bytes().map_err(|error| open_error(path, &error))?;
    let (db, _, damage) = Db::open_proving(path, &Retention::default(), u64::MAX)?;
    let db = db.writable()?;
    db.compact()?;
    db.close()?;
    Ok(Compacted { before, after: bytes().map_err(|error| open_error(path, &error))?, damage })
}

/// The audit log of a store that no daemon has open. Nothing of the store is changed: what is damaged is for the next start
/// to tell.
#[derive(Debug)]
pub struct AuditFile {
    connection: Connection,
    path: PathBuf,
    lost: Vec<Quarantined>,
}

impl AuditFile {
    /// Opens the store's files where they lie.
    ///
    /// # Errors
    /// [`StoreError`] if there is no store, a daemon has it, or it is not one of ours.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let path = idle(path)?;
        let lost = loss::found(&path).map_err(|error| open_error(&path, &error))?;
        let connection = in_place::open(&path)?;
        check_identity(&connection, &path)?;
        if !connection.table_exists(None, "audit").map_err(|error| StoreError::opening(&path, &error))? {
            return Err(StoreError::Foreign { path, reason: "it has no audit log".to_owned() });
        }
        Ok(Self { connection, path, lost })
    }

    /// What the store has lost, which the audit log may lack then. What of the log itself is damaged is in its entries.
    #[must_use]
    pub fn lost(&self) -> &[Quarantined] {
        &self.lost
    }

    /// Entries with numbers below `number`, at most so many, newest first.
    ///
    /// # Errors
    /// [`StoreError`] if they cannot be read, or are not what was written while a daemon has the store.
    pub fn before(&self, number: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        let read = audit_rows::read(&self.connection, number, most);
        let entries = read.map_err(|error| unless_in_use(&self.path, StoreError::opening(&self.path, &error)))?;
        if entries.iter().any(|entry| !entry.damage.is_empty()) {
            refuse_in_use(&self.path)?;
        }
        Ok(entries)
    }
}

/// Bytes of a store and its write-ahead log on the disk.
#[must_use]
pub fn size_on_disk(path: &Path) -> u64 {
    beside::bytes(&beside::real(path))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_copy_has_a_private_folder_of_its_own_and_goes_with_whoever_reads_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("other.db");
        fs::write(&path, "a database").unwrap();
        let without_log = Copied::of(&path).unwrap();
        fs::write(beside::wal(&path), "a log").unwrap();
        let with_log = Copied::of(&path).unwrap();
        assert_ne!(without_log.0, with_log.0);
        for (copied, has_log) in [(&without_log, false), (&with_log, true)] {
            assert_eq!(fs::metadata(&copied.0).unwrap().permissions().mode() & 0o777, 0o700);
            assert_eq!(fs::read(copied.database()).unwrap(), b"a database");
            assert_eq!(beside::wal(&copied.database()).exists(), has_log);
        }
        assert_eq!(fs::read(beside::wal(&with_log.database())).unwrap(), b"a log");
        let folders = [without_log.0.clone(), with_log.0.clone()];
        drop((without_log, with_log));
        assert!(folders.iter().all(|folder| !folder.exists()));
    }

    #[test]
    fn copies_that_were_left_are_passed_over_until_they_are_too_many() {
        let temporary = tempfile::tempdir().unwrap();
        let made: Vec<PathBuf> = (0..COPIES_MAX).map(|_| private_folder(temporary.path()).unwrap()).collect();
        assert!(made.iter().all(|folder| folder.is_dir() && folder.parent() == Some(temporary.path())));
        let said = private_folder(temporary.path()).unwrap_err().to_string();
        assert!(said.starts_with("100 copies of stores are in "), "{said}");
        let said = private_folder(&temporary.path().join("nowhere")).unwrap_err();
        assert_eq!(said.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_store_has_its_size_under_any_name() {
        let dir = tempfile::tempdir().unwrap();
        let [path, link] = ["store.db", "link"].map(|name| dir.path().join(name));
        std::os::unix::fs::symlink(&path, &link).unwrap();
        assert_eq!(size_on_disk(&link), 0);
        fs::write(&path, [0; 1000]).unwrap();
        fs::write(beside::wal(&path), [0; 24]).unwrap();
        assert_eq!([size_on_disk(&path), size_on_disk(&link)], [1024; 2]);
    }
}
