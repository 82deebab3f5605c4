//! What is done to a connection before it is used.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, ErrorCode, TransactionBehavior};

use crate::error::StoreError;
use crate::schema;

/// How long a start waits for a predecessor that is still closing the file.
pub(crate) const BUSY_TIMEOUT: Duration = Duration::from_secs(1);

/// Length of the write-ahead log at which it is folded back into the file: 1,000 pages of 4 KiB, SQLite's own default.
pub(crate) const WAL_BYTES_MAX: u64 = 4096 * 1000;

/// A file is rewritten at a start if half of it and at least so many pages, 4 MiB, are empty.
const FREE_PAGES_MIN: i64 = 1024;

/// Sets what holds of every connection.
pub(crate) fn configure(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY_TIMEOUT)?;
    // One process, one connection: a second daemon on the same file is refused instead of interleaving its numbers.
    connection.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    connection.pragma_update(None, "synchronous", "full")?;
    connection.pragma_update(None, "foreign_keys", true)?;
    // What is deleted is overwritten with zeros. The pages are used again.
    connection.pragma_update_and_check(None, "secure_delete", true, |_| Ok(()))?;
    connection.pragma_update(None, "trusted_schema", false)?;
    connection.pragma_update(None, "cell_size_check", true)?;
    connection.pragma_update_and_check(None, "journal_size_limit", WAL_BYTES_MAX as i64, |_| Ok(()))?;
    connection.pragma_update_and_check(None, "wal_autocheckpoint", 0, |_| Ok(()))
}

/// Has what is written go to the log first. A new database, or a copy that somebody made, is changed by this.
pub(crate) fn use_log(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let mut mode = String::new();
    // It is over when the last row was asked for.
    let used = connection.pragma(None, "journal_mode", "wal", |row| row.get(0).map(|found| mode = found));
    // The log itself is made by what reads next.
    let used = used.and_then(|()| connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(())));
    used.map_err(|error| match error.sqlite_error_code() {
        // The file itself is open.
        Some(ErrorCode::CannotOpen) => StoreError::Io(error.to_string()),
        _ => StoreError::opening(path, &error),
    })?;
    if mode != "wal" {
        let reason = format!("its file system has no write-ahead log (journal mode is `{mode}`)");
        return Err(StoreError::Open { path: path.to_path_buf(), reason });
    }
    Ok(())
}

/// Takes the steps that the file lacks, all or none; an empty file lacks every one.
pub(crate) fn bring_up_to_date(connection: &mut Connection) -> rusqlite::Result<()> {
    let version: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let lacking = schema::STEPS.get(usize::try_from(version).unwrap_or(0)..).unwrap_or_default();
    if lacking.is_empty() {
        return Ok(());
    }
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    transaction.pragma_update(None, "application_id", schema::APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", schema::VERSION)?;
    lacking.iter().try_for_each(|step| transaction.execute_batch(step))?;
    transaction.commit()
}

/// How many pages of a file are empty, if they are so many that it is to be rewritten.
pub(crate) fn space_to_give_back(connection: &Connection) -> rusqlite::Result<Option<i64>> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (pages, free) = (number("page_count")?, number("freelist_count")?);
    Ok((free >= FREE_PAGES_MIN && 2 * free >= pages).then_some(free))
}

/// Rewrites a file that is mostly empty pages, which deletions leave, and so gives their space back. This takes a
/// second for 100 MB, so it is done at a start and never while samples come.
pub(crate) fn give_back_space(connection: &Connection, path: &Path) -> rusqlite::Result<()> {
    let Some(free) = space_to_give_back(connection)? else { return Ok(()) };
    match connection.execute_batch("VACUUM") {
        Ok(()) => {
            tracing::info!(store = %path.display(), pages = free, "the store gave back the space of what was deleted")
        }
        // The file is as it was, and its empty pages are used again.
        Err(error) if error.sqlite_error_code() == Some(ErrorCode::DiskFull) => {
            tracing::warn!(store = %path.display(), %error, "no room to give back the space of what was deleted");
        }
        Err(error) => return Err(error),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A database with so many pages in use and so many empty ones, or some more.
    fn pages(used: i64, empty: i64) -> Connection {
        let connection = Connection::open_in_memory().unwrap();
        connection.execute_batch("CREATE TABLE used (b); CREATE TABLE empty (b)").unwrap();
        for (table, pages) in [("used", used), ("empty", empty)] {
            connection.execute(&format!("INSERT INTO {table} VALUES (zeroblob(?1 * 4092))"), [pages]).unwrap();
        }
        connection.execute_batch("DROP TABLE empty").unwrap();
        connection
    }

    #[test]
    fn space_is_given_back_if_half_of_it_and_four_megabytes_are_empty() {
        let given_back = |used, empty| space_to_give_back(&pages(used, empty)).unwrap().is_some();
        assert!(given_back(1_000, 1_100));
        assert!(!given_back(1_300, 1_100), "most of it is in use");
        assert!(!given_back(10, 900), "it is little");
        assert!(!given_back(1_300, 900));
    }
}
