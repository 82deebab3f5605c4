//! The tables, and what is done to a connection before it is used.
//!
//! All that is small is a fact: a row of one table with a kind, a key, a JSON text and a checksum. Samples of sessions are
//! blocks of those that were committed together. Model sets are texts, each with the summary that lists show.

use std::path::Path;

use rusqlite::{Connection, TransactionBehavior};

use crate::error::StoreError;
use crate::lock::BUSY_TIMEOUT;

/// `taxl`: marks the file as ours in its header.
pub(crate) const APPLICATION_ID: i64 = 0x7461_786C;

/// The version that this programme writes.
pub(crate) const VERSION: i64 = STEPS.len() as i64;

/// What makes each version from the one before, the first from an empty file. A step that was shipped never changes.
///
/// SQLite itself notices a flipped bit only in its own structure, so that every row has a checksum: see
/// [`facts`](crate::facts), [`samples`](crate::samples) and [`sets`](crate::sets).
const STEPS: [&str; 1] = ["
CREATE TABLE facts (
    kind   TEXT NOT NULL,
    name   TEXT NOT NULL,
    number INTEGER NOT NULL,
    body   TEXT NOT NULL,
    sum    BLOB NOT NULL,
    PRIMARY KEY (kind, name, number)
) STRICT, WITHOUT ROWID;

-- Samples `first` to `first + count` of a session.
CREATE TABLE samples (
    session INTEGER NOT NULL,
    first   INTEGER NOT NULL,
    count   INTEGER NOT NULL,
    block   BLOB NOT NULL,
    sum     BLOB NOT NULL,
    PRIMARY KEY (session, first, count)
) STRICT;

-- `sha256` is that of `json`, `sum` is over the other columns: a list needs no text.
CREATE TABLE model_sets (
    seq     INTEGER PRIMARY KEY,
    id      TEXT NOT NULL UNIQUE,
    summary TEXT NOT NULL,
    sha256  BLOB NOT NULL,
    sum     BLOB NOT NULL,
    json    BLOB NOT NULL
) STRICT;
"];

/// Length of the write-ahead log at which it is folded back into the file: 1,000 pages of 4 KiB, SQLite's own default.
pub(crate) const LOG_BYTES_MAX: u64 = 4096 * 1000;

/// A file is rewritten at a start if half of it and at least so many pages, 4 MiB, are empty.
const FREE_PAGES_MIN: i64 = 1024;

/// Sets what holds of every connection that writes.
pub(crate) fn configure(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY_TIMEOUT)?;
    // One process, one connection: a second program on the same file is refused instead of interleaving its rows.
    connection.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    connection.pragma_update(None, "synchronous", "full")?;
    // What is deleted is overwritten with zeros. The pages are used again.
    connection.pragma_update_and_check(None, "secure_delete", true, |_| Ok(()))?;
    connection.pragma_update(None, "trusted_schema", false)?;
    connection.pragma_update(None, "cell_size_check", true)?;
    // Folding back is done where its error is seen: see `Writer::tidy_log`.
    connection.pragma_update_and_check(None, "wal_autocheckpoint", 0, |_| Ok(()))
}

/// Has what is written go to the log first.
pub(crate) fn use_log(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let mut mode = String::new();
    // It is over when the last row was asked for.
    connection
        .pragma(None, "journal_mode", "wal", |row| row.get(0).map(|found| mode = found))
        .map_err(|error| StoreError::opening(path, &error))?;
    if mode == "wal" {
        return Ok(());
    }
    let reason = format!("its file system has no write-ahead log (journal mode is `{mode}`)");
    Err(StoreError::Open { path: path.to_path_buf(), reason })
}

/// Takes the steps that the file lacks, all or none; an empty file lacks every one.
pub(crate) fn bring_up_to_date(connection: &mut Connection) -> rusqlite::Result<()> {
    let version: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
    let lacking = STEPS.get(usize::try_from(version).unwrap_or(0)..).unwrap_or_default();
    if lacking.is_empty() {
        return Ok(());
    }
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    lacking.iter().try_for_each(|step| transaction.execute_batch(step))?;
    transaction.commit()
}

/// Whether the tables are those of this version.
pub(crate) fn has_our_tables(connection: &Connection) -> rusqlite::Result<bool> {
    let mut expected = Connection::open_in_memory()?;
    bring_up_to_date(&mut expected)?;
    Ok(tables(connection)? == tables(&expected)?)
}

fn tables(connection: &Connection) -> rusqlite::Result<Vec<(String, Option<String>)>> {
    let mut statement = connection.prepare("SELECT name, sql FROM sqlite_schema ORDER BY name")?;
    statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
}

/// Rewrites a file that is mostly empty pages, which deletions leave, and so gives their space back. This takes a second for
/// 100 MB, so it is done at a start and never while samples come.
pub(crate) fn give_back_space(connection: &Connection) -> rusqlite::Result<()> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (pages, free) = (number("page_count")?, number("freelist_count")?);
    if free < FREE_PAGES_MIN || 2 * free < pages {
        return Ok(());
    }
    match connection.execute_batch("VACUUM") {
        // The file is as it was, and its empty pages are used again.
        Err(error) if error.sqlite_error_code() == Some(rusqlite::ErrorCode::DiskFull) => {
            tracing::warn!(%error, "no room to give back the space of what was deleted");
            Ok(())
        }
        done => done.inspect(|()| tracing::info!(pages = free, "the store gave back the space of what was deleted")),
    }
}
