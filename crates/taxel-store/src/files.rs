//! The files of a store, all beside the database: its log, the copy, the lock, and what was set aside.
//!
//! Each is made for its owner alone: model sets, names of people and the audit log are in them. SQLite gives a log the mode of
//! its database, so that it is enough to make that one right.

use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use rusqlite::Connection;

use crate::error::StoreError;

/// Behind the name of the database: its log, and what SQLite may have beside it otherwise.
pub(crate) const LOG: &str = "-wal";
const SHARED: &str = "-shm";
pub(crate) const JOURNAL: &str = "-journal";

/// The copy, and one that is being made.
pub(crate) const COPY: &str = "-copy";
pub(crate) const COPY_PART: &str = "-copy-part";

/// What is to take the place of the database, until it is whole.
pub(crate) const NEW: &str = "-new";

/// What a process locks that has the store.
pub(crate) const LOCK: &str = "-lock";

/// What was set aside, before its date.
const ASIDE: &str = ".damaged-";

/// `path` with `suffix` behind its name.
pub(crate) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path.as_os_str());
    name.push(suffix);
    name.into()
}

/// The file itself that `path` names, which may be a link. SQLite has the log beside that, and so do we have all else. What
/// is not there yet has its name in the folder that is.
#[must_use]
pub fn real(path: &Path) -> PathBuf {
    if let Ok(real) = fs::canonicalize(path) {
        return real;
    }
    if let Ok(target) = fs::read_link(path) {
        let target = folder(path).join(target);
        return fs::canonicalize(folder(&target))
            .map_or(target.clone(), |real| real.join(target.file_name().unwrap_or_default()));
    }
    let named = fs::canonicalize(folder(path)).ok().zip(path.file_name());
    named.map_or(path.to_path_buf(), |(folder, name)| folder.join(name))
}

/// All names that the store at `path` has for its files, whether they are there now or not, and what it has set aside. Nobody
/// else may write to them.
fn files_of(path: &Path) -> Vec<PathBuf> {
    let path = real(path);
    let databases = ["", COPY, COPY_PART, NEW].map(|suffix| beside(&path, suffix));
    let of_sqlite = |database: &PathBuf| ["", LOG, SHARED, JOURNAL].map(|suffix| beside(database, suffix));
    databases.iter().flat_map(of_sqlite).chain([beside(&path, LOCK)]).chain(aside(&path)).collect()
}

/// Bytes of a store and its write-ahead log on the disk.
#[must_use]
pub fn size_on_disk(path: &Path) -> u64 {
    let path = real(path);
    length(&path) + length(&beside(&path, LOG))
}

/// Bytes of a file; 0 if there is none.
pub(crate) fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |file| file.len())
}

/// Takes the rights of all others from the files that are there. One that belongs to somebody else stays as it is.
pub(crate) fn make_private(path: &Path) {
    for file in files_of(path) {
        let open_to_others = fs::metadata(&file).is_ok_and(|found| found.is_file() && found.mode() & 0o077 != 0);
        if open_to_others && fs::set_permissions(&file, Permissions::from_mode(0o600)).is_err() {
            tracing::warn!(file = %file.display(), "others may read it, and this account cannot change that");
        }
    }
}

/// Makes an empty file for its owner alone, in place of one that a stop has left.
pub(crate) fn make_new(path: &Path, database: &Path) -> io::Result<()> {
    remove(path)?;
    for suffix in [LOG, JOURNAL] {
        remove(&beside(path, suffix))?;
    }
    let file = File::options().write(true).create_new(true).mode(0o600).open(path)?;
    give_to_owner_of(database, &file);
    Ok(())
}

/// Gives a file to the owner of the database, if root has made it: the daemon's account could not open it otherwise.
pub(crate) fn give_to_owner_of(database: &Path, file: &File) {
    if let Ok(owner) = fs::metadata(database) {
        let _ = fchown(file, Some(owner.uid()), Some(owner.gid()));
    }
}

/// Flushes a whole new file and gives it the name of another, which goes. After a power cut one of the two has the name.
pub(crate) fn put_in_place(new: &Path, path: &Path) -> Result<(), StoreError> {
    let put = || {
        File::open(new)?.sync_all()?;
        fs::rename(new, path)?;
        sync_folder(path)
    };
    put().map_err(|error| StoreError::changing(path, &error))
}

/// Gives the database and its log names with today's date. Gives that of the database.
pub(crate) fn set_aside(path: &Path) -> Result<PathBuf, StoreError> {
    let name = free_name(path)?;
    let set_aside = || {
        // The log first: a database without one is not mistaken for a whole one, a log without one would be for the next.
        for suffix in [LOG, JOURNAL, ""] {
            match fs::rename(beside(path, suffix), beside(&name, suffix)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        sync_folder(path)
    };
    set_aside().map(|()| name.clone()).map_err(|error| StoreError::changing(path, &error))
}

fn free_name(path: &Path) -> Result<PathBuf, StoreError> {
    let date: String =
        Connection::open_in_memory()?.query_row("SELECT strftime('%Y%m%dT%H%M%SZ')", [], |row| row.get(0))?;
    let names = (1_u32..1000).map(|number| match number {
        1 => beside(path, &format!("{ASIDE}{date}")),
        more => beside(path, &format!("{ASIDE}{date}-{more}")),
    });
    let free = |name: &PathBuf| ["", LOG].iter().all(|suffix| beside(name, suffix).symlink_metadata().is_err());
    let none = || StoreError::Io(format!("{}: no name is left to set it aside", path.display()));
    names.into_iter().find(free).ok_or_else(none)
}

/// What was set aside.
pub(crate) fn aside(path: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let begin = beside(Path::new(path.file_name().unwrap_or_default()), ASIDE);
    let entries = fs::read_dir(folder(path)).into_iter().flatten().flatten();
    let is_one = move |name: OsString| name.as_bytes().starts_with(begin.as_os_str().as_bytes());
    entries.filter(move |entry| is_one(entry.file_name())).map(|entry| entry.path())
}

/// Removes a file that may not be there.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// Makes names that were given or taken away outlive a power cut.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder(path))?.sync_all()
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// When a file was written, in words.
pub(crate) fn made(path: &Path) -> String {
    let seconds = fs::metadata(path).map_or(0, |file| file.mtime());
    let words = Connection::open_in_memory().and_then(|sqlite| {
        sqlite.query_row("SELECT strftime('%Y-%m-%d %H:%M:%S UTC', ?1, 'unixepoch')", [seconds], |row| row.get(0))
    });
    words.unwrap_or_else(|_| format!("{seconds} s after 1970"))
}
