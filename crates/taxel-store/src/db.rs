//! The one file: opened, checked, held exclusively, and flushed on commit.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, ErrorCode, TransactionBehavior};
use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::record::Record;

use crate::append::Appender;
use crate::error::{Quarantined, StoreError};
use crate::restore;
use crate::schema;

/// How long a start waits for a predecessor that is still closing the file.
const BUSY_TIMEOUT: Duration = Duration::from_secs(1);

/// Length of the write-ahead log at which it is folded back into the file: 1,000 pages of 4 KiB, SQLite's own default.
const WAL_BYTES_MAX: u64 = 4096 * 1000;

/// A file is rewritten at a start if half of it and at least so many pages, 4 MiB, are empty.
const FREE_PAGES_MIN: i64 = 1024;

/// The connection and what it must remember between transactions.
pub(crate) struct Db {
    connection: Connection,
    /// The write-ahead log; `None` if all is in memory.
    wal: Option<PathBuf>,
    appender: Appender,
    /// Something was deleted that the write-ahead log still holds.
    erasing: bool,
}

impl Db {
    /// Opens or creates the file, checks all of it and reads what a start needs.
    pub(crate) fn open(path: &Path) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
        let mut connection = Connection::open(path).map_err(opening)?;
        configure(&connection).map_err(opening)?;
        check_identity(&connection, path)?;
        let mode: String =
            connection.pragma_update_and_check(None, "journal_mode", "wal", |row| row.get(0)).map_err(opening)?;
        if mode != "wal" {
            let reason = format!("its file system has no write-ahead log (journal mode is `{mode}`)");
            return Err(StoreError::Open { path: path.to_path_buf(), reason });
        }
        check_structure(&connection, path)?;
        bring_up_to_date(&mut connection).map_err(opening)?;
        give_back_space(&connection, path).map_err(opening)?;
        let (restored, quarantined) = restore::read(&connection).map_err(opening)?;
        let appender = Appender::new(restored.model_sets.iter().map(|set| set.id.clone()));
        let mut wal = path.as_os_str().to_owned();
        wal.push("-wal");
        let db = Self { connection, wal: Some(wal.into()), appender, erasing: false };
        // What an earlier run deleted may still be in the log if it was killed then.
        db.checkpoint().map_err(|error| StoreError::Open { path: path.to_path_buf(), reason: error.to_string() })?;
        Ok((db, restored, quarantined))
    }

    /// A store that ends with the process.
    pub(crate) fn in_memory() -> Result<Self, StoreError> {
        let mut connection = Connection::open_in_memory()?;
        configure(&connection)?;
        bring_up_to_date(&mut connection)?;
        Ok(Self { connection, wal: None, appender: Appender::new(None), erasing: false })
    }

    /// Whether what is committed survives the process.
    pub(crate) fn is_on_disk(&self) -> bool {
        self.wal.is_some()
    }

    /// Writes all records or none, and returns once the disk has them: per session, how many of its samples it has now.
    pub(crate) fn write<'a>(
        &mut self,
        records: impl Iterator<Item = &'a Record>,
    ) -> Result<Vec<(u64, u64)>, StoreError> {
        let transaction = self.connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for record in records {
            self.erasing |= matches!(record, Record::ModelSetDeleted { .. } | Record::SessionDeleted { .. });
            self.appender.append(&transaction, record)?;
        }
        let grown = self.appender.finish(&transaction)?;
        transaction.commit()?;
        Ok(grown)
    }

    /// The samples and ramps of a session, each proven, or why they cannot be trusted.
    pub(crate) fn samples(&self, session: u64) -> Result<SessionSamples, String> {
        restore::samples(&self.connection, session)
    }

    /// Folds the write-ahead log back if it holds what was deleted.
    pub(crate) fn erase(&mut self) -> Result<(), StoreError> {
        if std::mem::take(&mut self.erasing) && self.is_on_disk() { self.checkpoint() } else { Ok(()) }
    }

    /// Folds the write-ahead log back once it is long.
    ///
    /// SQLite would do so by itself, but it ignores an error there and tries again later; after a failed flush the
    /// kernel may have dropped the pages and call the second try a success. Here the error is seen and is final.
    pub(crate) fn checkpoint_if_long(&self) -> Result<(), StoreError> {
        let Some(wal) = &self.wal else { return Ok(()) };
        let length = fs::metadata(wal).map_or(0, |file| file.len());
        if length > WAL_BYTES_MAX { self.checkpoint() } else { Ok(()) }
    }

    fn checkpoint(&self) -> Result<(), StoreError> {
        self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))?;
        Ok(())
    }

    /// Folds the log back and closes the file.
    pub(crate) fn close(self) -> Result<(), StoreError> {
        if self.is_on_disk() {
            self.checkpoint()?;
        }
        self.connection.close().map_err(|(_, error)| error.into())
    }

    /// Closes the file after a failure without writing or flushing anything more.
    pub(crate) fn abandon(self) {
        // If even this is refused, the checkpoint at closing is SQLite's own risk; nothing acknowledged hangs on it.
        let _ = self.connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true);
    }

    /// Lets the file grow by no more than `pages`, so that tests meet a full disk.
    #[cfg(any(test, feature = "fixtures"))]
    pub(crate) fn limit_growth(&self, pages: i64) -> Result<(), StoreError> {
        let now: i64 = self.connection.pragma_query_value(None, "page_count", |row| row.get(0))?;
        let set = |row: &rusqlite::Row<'_>| row.get::<_, i64>(0);
        self.connection.pragma_update_and_check(None, "max_page_count", now + pages, set)?;
        Ok(())
    }
}

fn configure(connection: &Connection) -> rusqlite::Result<()> {
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

/// Refuses what is not ours or is newer than we are; lets an empty file pass.
fn check_identity(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (application, version) = (number("application_id").map_err(opening)?, number("user_version").map_err(opening)?);
    if is_empty(connection).map_err(opening)? && (application, version) == (0, 0) {
        return Ok(());
    }
    let path = path.to_path_buf();
    if application != schema::APPLICATION_ID {
        let expected = schema::APPLICATION_ID;
        let reason = format!("its application id is {application:#x}, expected {expected:#x}");
        return Err(StoreError::Foreign { path, reason });
    }
    if version > schema::VERSION {
        return Err(StoreError::TooNew { path, found: version, newest: schema::VERSION });
    }
    if version < 1 {
        let findings = format!("its schema version is {version}, which never existed");
        return Err(StoreError::Damaged { path, findings });
    }
    Ok(())
}

fn is_empty(connection: &Connection) -> rusqlite::Result<bool> {
    connection.query_row("SELECT count(*) = 0 FROM sqlite_schema", [], |row| row.get(0))
}

/// Takes the steps that the file lacks, all or none; an empty file lacks every one.
fn bring_up_to_date(connection: &mut Connection) -> rusqlite::Result<()> {
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

/// Rewrites a file that is mostly empty pages, which deletions leave, and so gives their space back. This takes a
/// second for 100 MB, so it is done at a start and never while samples come.
fn give_back_space(connection: &Connection, path: &Path) -> rusqlite::Result<()> {
    let number = |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let (pages, free) = (number("page_count")?, number("freelist_count")?);
    if free < FREE_PAGES_MIN || 2 * free < pages {
        return Ok(());
    }
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

/// Reads every page once and checks its structure.
fn check_structure(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let opening = |error: rusqlite::Error| StoreError::opening(path, &error);
    let mut findings = Vec::new();
    connection
        .pragma_query(None, "quick_check", |row| {
            findings.push(row.get::<_, String>(0)?);
            Ok(())
        })
        .map_err(opening)?;
    if findings == ["ok"] {
        return Ok(());
    }
    let more = findings.len().saturating_sub(3);
    findings.truncate(3);
    let mut findings = findings.join("; ").replace('\n', " ");
    if more > 0 {
        findings += &format!("; and {more} more");
    }
    Err(StoreError::Damaged { path: path.to_path_buf(), findings })
}
