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
    let tried = if is_read_only && error.is_none_or(lock_failed) {
        (path.to_path_buf(), File::options().write(true).open(path))
    } else if log_failed {
        let log = beside::wal(path);
        let opened = File::options().write(true).create(true).truncate(false).open(&log);
        (log, opened)
    } else {
        return None;
    };
    let (file, opened) = tried;
    let why = opened.err().unwrap_or_else(|| io::ErrorKind::ReadOnlyFilesystem.into());
    Some(StoreError::changing(&file, &why))
}
