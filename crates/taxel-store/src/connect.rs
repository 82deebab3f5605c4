//! A database is opened: to be written, or where it lies without changing or locking anything.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::Read;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};

use crate::error::StoreError;
use crate::files::{JOURNAL, LOG, beside, length};
use crate::schema;

/// SQLite's name for files without locks: a file that cannot be written cannot be locked either.
const WITHOUT_LOCKS: &str = "unix-none";

/// Every SQLite file begins so.
const HEADER: &[u8] = b"SQLite format 3\0";

/// A file up to this size is looked at whole at a start, which takes some hundred milliseconds. Of a larger one the samples of
/// sessions are left out: each block of them is proven when it is read.
const WHOLE_BYTES_MAX: u64 = 64 << 20;

/// Opens a database to be written. Closing it changes nothing until [`close`].
pub(crate) fn to_write(path: &Path) -> Result<Connection, StoreError> {
    refuse_no_file(path)?;
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let connection = Connection::open_with_flags(path, flags).map_err(opening)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true).map_err(opening)?;
    schema::configure(&connection).map_err(opening)?;
    if connection.is_readonly("main").map_err(opening)? {
        let error = File::options().write(true).open(path).err();
        return Err(StoreError::changing(path, &error.unwrap_or(std::io::ErrorKind::ReadOnlyFilesystem.into())));
    }
    Ok(connection)
}

/// Closes a database. Its log is folded back into it and removed.
pub(crate) fn close(connection: Connection) -> Result<(), StoreError> {
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, false)?;
    connection.close().map_err(|(_, error)| error.into())
}

/// Opens a database with its log, if there is one, and changes nothing. The log's index is held in memory.
pub(crate) fn to_read(path: &Path) -> Result<Connection, StoreError> {
    refuse_no_file(path)?;
    open_to_read(path).map_err(|error| StoreError::opening(path, &error))
}

fn open_to_read(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = if beside(path, LOG).exists() {
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

/// A device would be written to, and a pipe be waited for.
fn refuse_no_file(path: &Path) -> Result<(), StoreError> {
    for file in [path.to_path_buf(), beside(path, LOG), beside(path, JOURNAL)] {
        if fs::metadata(&file).is_ok_and(|found| !found.is_file()) {
            return Err(StoreError::Open { path: file, reason: "is no regular file".to_owned() });
        }
    }
    Ok(())
}

/// Refuses what is not ours, is newer than we are, or is not whole.
pub(crate) fn check(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    check_with(connection, path, length(path) <= WHOLE_BYTES_MAX)
}

/// As [`check`]; the `whole` file if that is asked for.
pub(crate) fn check_with(connection: &Connection, path: &Path, whole: bool) -> Result<(), StoreError> {
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (application, version) = (number("application_id").map_err(opening)?, number("user_version").map_err(opening)?);
    let path = path.to_path_buf();
    if application != schema::APPLICATION_ID {
        let reason = format!("its application id is {application:#x}, expected {:#x}", schema::APPLICATION_ID);
        return Err(StoreError::Foreign { path, reason });
    }
    if version > schema::VERSION {
        return Err(StoreError::TooNew { path, found: version, newest: schema::VERSION });
    }
    let findings = structure(connection, whole).map_err(opening)?;
    let has_tables = version == schema::VERSION && schema::has_our_tables(connection).map_err(opening)?;
    let findings =
        findings.or((!has_tables).then(|| format!("its tables are not those of version {}", schema::VERSION)));
    findings.map_or(Ok(()), |findings| Err(StoreError::Damaged { path, findings }))
}

/// Whether it begins as every SQLite file.
pub(crate) fn has_header(path: &Path) -> bool {
    let mut begin = [0; HEADER.len()];
    File::open(path).and_then(|mut file| file.read_exact(&mut begin)).is_ok_and(|()| begin == HEADER)
}

/// What is wrong with how the pages hang together; `None` if all is well.
fn structure(connection: &Connection, whole: bool) -> rusqlite::Result<Option<String>> {
    let checks: &[&str] = if whole { &["quick_check(3)"] } else { &["quick_check(facts)", "quick_check(model_sets)"] };
    for check in checks {
        let mut statement = connection.prepare(&format!("PRAGMA {check}"))?;
        let lines = statement.query_map([], |row| row.get::<_, String>(0))?.collect::<Result<Vec<_>, _>>()?;
        if lines != ["ok"] {
            return Ok(Some(lines.join("; ").replace('\n', " ")));
        }
    }
    Ok(None)
}
