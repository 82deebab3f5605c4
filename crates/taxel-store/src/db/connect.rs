//! The file is opened to be written, or where it lies if the disk takes nothing.

use std::fs::File;
use std::io;
use std::path::Path;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, ffi};

use crate::error::StoreError;
use crate::prepare::configure;
use crate::{beside, in_place};

/// Opens the file, and tells why it can only be read, if so: `failure` if something failed before, or what was met now.
///
/// Until all is known to be well, closing it changes nothing.
///
/// # Errors
/// [`StoreError`] if it cannot be read, either, or another process has it.
pub(crate) fn connect(
    path: &Path,
    failure: Option<StoreError>,
) -> Result<(Connection, Option<StoreError>), StoreError> {
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let read_only = |failure| Ok((in_place::open(path)?, Some(failure)));
    if let Some(failure) = failure {
        return read_only(failure);
    }
    beside::make_private(path);
    let connection = Connection::open(path).map_err(opening)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true).map_err(opening)?;
    let looked = configure(&connection)
        .and_then(|()| connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(())));
    let is_read_only = connection.is_readonly("main").map_err(opening)?;
    match why_unwritable(path, is_read_only, looked.as_ref().err()) {
        Some(why) => {
            drop(connection);
            tracing::error!(error = %why, "the store cannot be written: what is in it is served as it is");
            read_only(why)
        }
        // An error of the file's content shows again where it is looked for.
        None => Ok((connection, None)),
    }
}

/// Why a file that can be read cannot be written. SQLite opens it all the same, and cannot lock it; or it cannot make the log.
fn why_unwritable(path: &Path, is_read_only: bool, error: Option<&rusqlite::Error>) -> Option<StoreError> {
    let lock_failed = |error: &rusqlite::Error| {
        error.sqlite_error().is_some_and(|error| error.extended_code == ffi::SQLITE_IOERR_LOCK)
    };
    let log_failed = error.is_some_and(|error| error.sqlite_error_code() == Some(ErrorCode::CannotOpen));
    let (file, opened) = if is_read_only && error.is_none_or(lock_failed) {
        (path.to_path_buf(), File::options().write(true).open(path).map(drop))
    } else if log_failed {
        let log = beside::wal(path);
        let opened = can_be_opened(&log);
        (log, opened)
    } else {
        return None;
    };
    Some(match (opened, error) {
        (Err(why), _) => StoreError::changing(&file, &why),
        // What was in the way is there no more, for example that too many files were open: SQLite's words are all there is.
        (Ok(()), Some(error)) => StoreError::Io(format!("{}: {error}", file.display())),
        (Ok(()), None) => StoreError::Io(format!("{}: it could be opened to be read alone", file.display())),
    })
}

/// Whether the log can be opened to be written, or made; one that is made for this is removed again, as it is no log of a start.
fn can_be_opened(log: &Path) -> io::Result<()> {
    let mut options = File::options();
    match options.write(true).create_new(true).open(log) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => options.create_new(false).open(log).map(drop),
        made => made.and_then(|_| beside::remove(log)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_log_is_made_to_see_whether_it_can_be_and_none_is_left_or_lost() {
        let dir = tempfile::tempdir().unwrap();
        let log = dir.path().join("store.db-wal");
        can_be_opened(&log).unwrap();
        assert!(!log.exists());
        fs::write(&log, "frames").unwrap();
        can_be_opened(&log).unwrap();
        assert_eq!(fs::read(&log).unwrap(), b"frames");
        assert_eq!(can_be_opened(dir.path()).unwrap_err().kind(), io::ErrorKind::IsADirectory);
        assert_eq!(can_be_opened(&log.join("below")).unwrap_err().kind(), io::ErrorKind::NotADirectory);
    }

    /// What was in the way may have gone, and is named where it has not.
    #[test]
    fn what_cannot_be_written_is_named_with_the_reason() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        fs::write(&path, "").unwrap();
        let failed = |code| rusqlite::Error::SqliteFailure(ffi::Error::new(code), None);
        let [lock, log, content] = [ffi::SQLITE_IOERR_LOCK, ffi::SQLITE_CANTOPEN, ffi::SQLITE_CORRUPT].map(failed);
        let said =
            |path: &Path, is_read_only, error| why_unwritable(path, is_read_only, error).map(|why| why.to_string());
        assert_eq!(said(&path, false, None), None);
        assert_eq!(said(&path, false, Some(&lock)), None, "its words are SQLite's");
        assert_eq!(said(&path, true, Some(&content)), None, "it shows again");
        let ends = |said: Option<String>, end: &str| {
            assert!(said.as_ref().is_some_and(|said| said.ends_with(end)), "{said:?}")
        };
        ends(said(&path, true, None), "store.db: it could be opened to be read alone");
        ends(said(&path, true, Some(&lock)), &format!("store.db: {lock}"));
        ends(said(&path, false, Some(&log)), &format!("store.db-wal: {log}"));
        assert!(!beside::wal(&path).exists());
        fs::create_dir(beside::wal(&path)).unwrap();
        let why = why_unwritable(&path, false, Some(&log)).unwrap();
        assert!(why.is_of_changing() && why.to_string().contains("store.db-wal: Is a directory"), "{why}");
        let why = why_unwritable(dir.path(), true, None).unwrap();
        assert!(why.is_of_changing() && why.to_string().contains("Is a directory"), "{why}");
    }
}
