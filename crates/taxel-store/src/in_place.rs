//! A database is read where it lies, without changing or locking anything: on a disk that takes nothing, and where there is
//! no room for a copy.

use std::ffi::OsString;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};

use crate::beside;
use crate::error::StoreError;

/// SQLite's name for files without locks: a file that cannot be written cannot be locked either.
const WITHOUT_LOCKS: &str = "unix-none";

/// Opens a database with its log, if there is one. The log's index is held in memory.
///
/// # Errors
/// If there is no such file, or it cannot be read.
pub(crate) fn open(path: &Path) -> Result<Connection, StoreError> {
    let journal = beside::journal(path);
    if beside::is_no_file(&journal) {
        return Err(StoreError::Open { path: journal, reason: "it is in the way and no regular file".to_owned() });
    }
    open_files(path).map_err(|error| StoreError::opening(path, &error))
}

fn open_files(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let log = beside::wal(path);
    let connection = if log.exists() && !beside::is_no_file(&log) {
        Connection::open_with_flags_and_vfs(path, flags, WITHOUT_LOCKS)?
    } else {
        // SQLite would make a log, but not for what it is told never to change.
        Connection::open_with_flags(immutable(path), flags | OpenFlags::SQLITE_OPEN_URI)?
    };
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true)?;
    connection.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    connection.pragma_update(None, "trusted_schema", false)?;
    connection.pragma_update(None, "cell_size_check", true)?;
    Ok(connection)
}

/// The file as a URI that says so.
fn immutable(path: &Path) -> PathBuf {
    let mut uri = b"file:".to_vec();
    for &byte in path.as_os_str().as_bytes() {
        match byte {
            b'%' | b'?' | b'#' => uri.extend(format!("%{byte:02x}").bytes()),
            byte => uri.push(byte),
        }
    }
    uri.extend(b"?immutable=1");
    OsString::from_vec(uri).into()
}
