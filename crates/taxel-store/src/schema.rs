//! The tables, and what is done to a connection before it is used.
//!
//! Nearly all is a fact: a row of one table with a kind, a key, a text and a checksum. Samples of sessions are blocks of those
//! that were committed together.

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
/// [`facts`](crate::facts) and [`samples`](crate::samples).
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
"];

/// Length of the write-ahead log at which it is folded back into the file: 1,000 pages of 4 KiB, SQLite's own default.
pub(crate) const LOG_BYTES_MAX: u64 = 4096 * 1000;

/// A file is rewritten at a start if half of it and at least so many pages, 4 MiB, are empty.
const FREE_PAGES_MIN: u64 = 1024;

/// Sets what holds of every connection that writes.
pub(crate) fn configure(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY_TIMEOUT)?;
    // One process, one connection: a second program on the same file is refused instead of interleaving its rows.
    connection.pragma_update_and_check(None, "locking_mode", "exclusive", |_| Ok(()))?;
    connection.pragma_update(None, "synchronous", "full")?;
    // What is deleted is overwritten with zeros. The pages are used again.
    connection.pragma_update_and_check(None, "secure_delete", true, |_| Ok(()))?;
    connection.pragma_update(None, "cell_size_check", true)?;
    // Folding back is done where its error is seen: see `State::tidy_log`.
    connection.pragma_update_and_check(None, "wal_autocheckpoint", 0, |_| Ok(()))
}

/// Has what is written go to the log first.
pub(crate) fn use_log(connection: &Connection) -> Result<(), StoreError> {
    let mut mode = String::new();
    // It is over when the last row was asked for.
    connection.pragma(None, "journal_mode", "wal", |row| row.get(0).map(|found| mode = found))?;
    if mode == "wal" {
        return Ok(());
    }
    Err(StoreError::Disk(format!("its file system has no write-ahead log (journal mode is `{mode}`)")))
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

/// How many pages there are, how many of them are empty, and the bytes of one.
pub(crate) fn pages(connection: &Connection) -> rusqlite::Result<[u64; 3]> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get(0));
    Ok([number("page_count")?, number("freelist_count")?, number("page_size")?])
}

/// Rewrites a file that is mostly empty pages, which deletions leave, and so gives their space back. This takes a second for
/// 100 MB, so it is done at a start and never while samples come.
pub(crate) fn give_back_space(connection: &Connection) -> rusqlite::Result<()> {
    let [pages, free, _] = pages(connection)?;
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
