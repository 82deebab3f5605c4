//! The files of a store, all beside the database: its log, the copy, the lock, and what was set aside.
//!
//! Each is made for its owner alone: model sets, names of people and the audit log are in them. SQLite gives a log the mode of
//! its database, so that it is enough to make that one right.

use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};

use rusqlite::Connection;

use crate::error::StoreError;

/// Behind the name of the database: its log, and what SQLite may have beside it otherwise.
pub(crate) const LOG: &str = "-wal";
const JOURNAL: &str = "-journal";

/// The copy, and one that is being made.
pub(crate) const COPY: &str = "-copy";
pub(crate) const COPY_PART: &str = "-copy-part";

/// What is to take the place of the database, until it is whole.
pub(crate) const NEW: &str = "-new";

/// What a process locks that has the store.
pub(crate) const LOCK: &str = "-lock";

/// `path` with `suffix` behind its name.
pub(crate) fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path.as_os_str());
    name.push(suffix);
    name.into()
}

/// The file itself that `path` names, which may be a link: SQLite has the log beside that.
pub(crate) fn real(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
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
    for file in ["", LOG, COPY, LOCK].map(|suffix| beside(path, suffix)) {
        let open_to_others = fs::metadata(&file).is_ok_and(|found| found.is_file() && found.mode() & 0o077 != 0);
        if open_to_others && fs::set_permissions(&file, Permissions::from_mode(0o600)).is_err() {
            tracing::warn!(file = %file.display(), "others may read it, and this account cannot change that");
        }
    }
}

/// Makes an empty file for its owner alone, in place of one that a stop has left.
pub(crate) fn make_new(path: &Path, database: &Path) -> Result<(), StoreError> {
    let make = || {
        for suffix in ["", LOG, JOURNAL] {
            or_not_there(fs::remove_file(beside(path, suffix)))?;
        }
        let file = File::options().write(true).create_new(true).mode(0o600).open(path)?;
        give_to_owner_of(database, &file);
        Ok(())
    };
    make().map_err(|error| StoreError::of_file(path, &error))
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
    put().map_err(|error| StoreError::of_file(path, &error))
}

/// Gives the database and its log names with the time in them. Gives that of the database.
pub(crate) fn set_aside(path: &Path) -> Result<PathBuf, StoreError> {
    let name = beside(path, &format!(".damaged-{}", date("%Y%m%dT%H%M%SZ", "now")));
    let set_aside = || {
        // The log first: a database without one is not mistaken for a whole one, a log without one would be for the next.
        for suffix in [LOG, JOURNAL, ""] {
            or_not_there(fs::rename(beside(path, suffix), beside(&name, suffix)))?;
        }
        sync_folder(path)
    };
    set_aside().map_err(|error| StoreError::of_file(path, &error))?;
    Ok(name)
}

/// A file that is not there is as good as one that was removed.
fn or_not_there(done: io::Result<()>) -> io::Result<()> {
    done.or_else(|error| if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) })
}

/// Makes names that were given or taken away outlive a power cut.
fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

/// When a file was written, in words.
pub(crate) fn made(path: &Path) -> String {
    let seconds = fs::metadata(path).map_or(0, |file| file.mtime());
    date("%Y-%m-%d %H:%M:%S UTC", &format!("@{seconds}"))
}

/// A moment as SQLite writes it: `now`, or seconds since 1970 behind an `@`.
fn date(format: &str, moment: &str) -> String {
    let words = Connection::open_in_memory().and_then(|sqlite| match moment.strip_prefix('@') {
        Some(seconds) => sqlite.query_row("SELECT strftime(?1, ?2, 'unixepoch')", [format, seconds], |row| row.get(0)),
        None => sqlite.query_row("SELECT strftime(?1, 'now')", [format], |row| row.get(0)),
    });
    words.unwrap_or_else(|_| moment.to_owned())
}
