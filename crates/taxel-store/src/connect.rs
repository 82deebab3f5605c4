//! A database is opened and looked at: to be written, or where it lies without changing or locking anything.

use std::path::Path;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};

use crate::error::StoreError;
use crate::files::{LOG, beside, length};
use crate::schema;

/// SQLite's name for files without locks: a file that cannot be written cannot be locked either.
const WITHOUT_LOCKS: &str = "unix-none";

/// A file up to this size is looked at whole at a start, which takes some hundred milliseconds. Of a larger one the samples of
/// sessions are left out: each block of them is proven when it is read.
const WHOLE_BYTES_MAX: u64 = 64 << 20;

/// Opens a database to be written. Closing it changes nothing until [`close`].
pub(crate) fn to_write(path: &Path) -> Result<Connection, StoreError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let mut connection = Connection::open_with_flags(path, flags)?;
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    schema::configure(&connection)?;
    if connection.is_readonly("main")? {
        let error = std::fs::File::options().write(true).open(path).err();
        return Err(StoreError::of_file(path, &error.unwrap_or(std::io::ErrorKind::ReadOnlyFilesystem.into())));
    }
    check(&connection, length(path) <= WHOLE_BYTES_MAX)?;
    schema::bring_up_to_date(&mut connection)?;
    Ok(connection)
}

/// Closes a database. Its log is folded back into it and removed.
pub(crate) fn close(connection: Connection) -> Result<(), StoreError> {
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, false)?;
    connection.close().map_err(|(_, error)| error.into())
}

/// Opens a database with its log, if there is one, and changes nothing. The log's index is held in memory.
pub(crate) fn to_read(path: &Path) -> Result<Connection, StoreError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = if beside(path, LOG).exists() {
        Connection::open_with_flags_and_vfs(path, flags, WITHOUT_LOCKS)?
    } else {
        // SQLite would make a log, but not for what it is told never to change.
        let name = path.to_string_lossy().replace('%', "%25").replace('?', "%3f").replace('#', "%23");
        Connection::open_with_flags(format!("file:{name}?immutable=1"), flags | OpenFlags::SQLITE_OPEN_URI)?
    };
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)?;
    connection.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    connection.pragma_update(None, "cell_size_check", true)?;
    check(&connection, length(path) <= WHOLE_BYTES_MAX)?;
    Ok(connection)
}

/// Refuses what is not ours, is newer than we are, or whose pages do not hang together: of the `whole` file, or of all but its
/// samples.
pub(crate) fn check(connection: &Connection, whole: bool) -> Result<(), StoreError> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (application, found) = (number("application_id")?, number("user_version")?);
    if application != schema::APPLICATION_ID {
        let expected = schema::APPLICATION_ID;
        return Err(StoreError::Foreign(format!("its application id is {application:#x}, expected {expected:#x}")));
    }
    if found > schema::VERSION {
        return Err(StoreError::TooNew { found, newest: schema::VERSION });
    }
    let check = if whole { "PRAGMA quick_check(3)" } else { "PRAGMA quick_check(facts)" };
    let mut statement = connection.prepare(check)?;
    let lines = statement.query_map([], |row| row.get::<_, String>(0))?.collect::<Result<Vec<_>, _>>()?;
    if lines == ["ok"] { Ok(()) } else { Err(StoreError::Damaged(lines.join("; ").replace('\n', " "))) }
}
