//! The one file: opened, checked, held exclusively, and flushed on commit.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use rusqlite::config::DbConfig;
use rusqlite::hooks::Wal;
use rusqlite::{Connection, TransactionBehavior};
use taxel_engine::Restored;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::record::Record;

use crate::active_file::IdAndText;
use crate::append::Appender;
use crate::audit_rows;
use crate::error::StoreError;
use crate::held_files::HeldFiles;
use crate::lock::StoreLock;
use crate::open_mark::{self, OpenMark};
use crate::pass::{Finding, Lost, Step, Unproven};
use crate::prepare::{WAL_BYTES_MAX, bring_up_to_date, configure};
use crate::retention::{self, Retention, Size};
use crate::{active_file, beside, restore, session_samples, sets};

mod active;
mod connect;
mod open;

/// The connection and what it must remember between transactions.
pub(crate) struct Db {
    connection: Connection,
    /// The file; `None` if all is in memory.
    path: Option<PathBuf>,
    appender: Appender,
    /// Something was deleted that the write-ahead log still holds.
    erasing: bool,
    /// A model set was activated since the plain file of the active ones was written.
    activated: bool,
    /// What is not proven yet.
    unproven: Unproven,
    /// The files that are open; `None` until something is written, and in memory.
    held: Option<HeldFiles>,
    /// How many pages the log has up to its last commit.
    log_pages: Arc<AtomicU32>,
    /// The first change that failed during the start. Nothing was changed after it, and nothing may be.
    failure: Option<StoreError>,
    /// How many texts of model sets the start has read.
    #[cfg(test)]
    pub(crate) texts_read: usize,
    /// That this process alone has the store; it is let go after the connection is closed.
    lock: Option<StoreLock>,
}

/// What opening a file came to, beside what the engine starts from.
#[derive(Default)]
struct Opened {
    /// The row of each model set.
    rows_of_sets: Vec<(String, u64)>,
    unproven: Unproven,
    /// How many texts of model sets were read.
    texts_read: usize,
    /// The first change that failed.
    failure: Option<StoreError>,
}

impl Db {
    fn new(connection: Connection, path: Option<PathBuf>, found: Option<Opened>) -> Self {
        let Opened { rows_of_sets, unproven, texts_read, failure } = found.unwrap_or_default();
        #[cfg(not(test))]
        let _ = texts_read;
        Self {
            connection,
            path,
            appender: Appender::new(rows_of_sets),
            erasing: false,
            activated: false,
            unproven,
            held: None,
            log_pages: Arc::default(),
            failure,
            #[cfg(test)]
            texts_read,
            lock: None,
        }
    }

    /// Does what changes the store during a start, unless a change has failed before. That the disk is full, read-only or
    /// fails is remembered and keeps nobody from what was read.
    ///
    /// # Errors
    /// Any other error.
    fn attempt(&mut self, change: impl FnOnce(&mut Self) -> Result<(), StoreError>) -> Result<(), StoreError> {
        if self.failure.is_some() {
            return Ok(());
        }
        match change(self) {
            Err(error) if error.is_of_changing() => {
                tracing::error!(%error, "the store cannot be written: what is in it is served as it is");
                self.failure = Some(error);
                Ok(())
            }
            changed => changed,
        }
    }

    /// The store, if it takes something.
    ///
    /// # Errors
    /// The first change that failed during the start.
    pub(crate) fn writable(mut self) -> Result<Self, StoreError> {
        self.failure.take().map_or(Ok(self), Err)
    }

    /// Deletes what is beyond the limits.
    fn retain(&mut self, restored: &mut Restored, limits: &Retention) -> Result<(), StoreError> {
        if !limits.limits() {
            return Ok(());
        }
        let sets = retention::sets_to_go(restored, limits);
        self.write(sets.iter())?;
        for set in sets {
            let Record::ModelSetDeleted { model_set, .. } = set else { continue };
            tracing::info!(model_set, "deleted: more model sets than are to be kept");
            restored.model_sets.retain(|set| set.id != model_set);
        }
        while let Some(record) = retention::session_to_go(restored, self.size()?, limits) {
            let Record::SessionDeleted { session, .. } = record else { break };
            self.write([record].iter())?;
            tracing::info!(session, "deleted: more sessions than are to be kept");
            restored.sessions.retain(|view| view.number != session);
        }
        self.erase()
    }

    /// What the database holds.
    pub(crate) fn size(&self) -> Result<Size, StoreError> {
        Ok(retention::size(&self.connection)?)
    }

    /// Rewrites the file without its empty pages.
    pub(crate) fn compact(&self) -> Result<(), StoreError> {
        self.connection.execute_batch("VACUUM")?;
        self.checkpoint()
    }

    /// Writes the plain file of the active model sets if one was activated since. Without it the database alone has them,
    /// so that a failure is told and ends nothing.
    pub(crate) fn keep_active(&mut self) {
        let Some(path) = self.path.clone().filter(|_| std::mem::take(&mut self.activated)) else { return };
        let content = self
            .active_texts()
            .map_err(|error| error.to_string())
            .and_then(|(newest, texts)| active_file::content(newest, &texts).map_err(|error| error.to_string()));
        let kept = content.and_then(|content| active_file::keep(&path, &content).map_err(|error| error.to_string()));
        if let Err(error) = kept {
            tracing::warn!(store = %path.display(), %error, "the plain file of the active model sets was not written");
        }
    }

    /// The newest activation of all, and the id and text of each set that is active.
    fn active_texts(&self) -> Result<(u64, Vec<IdAndText>), StoreError> {
        let newest = restore::newest_activation(&self.connection)?;
        let mut found = Vec::new();
        for (patch, id) in restore::active_now(&self.connection)? {
            match restore::text_of(&self.connection, &id)? {
                Some(text) => found.push((id, text)),
                None => tracing::warn!(patch, model_set = id, "the active model set has no sound row in the store"),
            }
        }
        Ok((newest, found))
    }

    /// A store that ends with the process.
    pub(crate) fn in_memory() -> Result<Self, StoreError> {
        let mut connection = Connection::open_in_memory()?;
        configure(&connection)?;
        bring_up_to_date(&mut connection)?;
        Ok(Self::new(connection, None, None))
    }

    /// Whether what is committed survives the process.
    pub(crate) fn is_on_disk(&self) -> bool {
        self.path.is_some()
    }

    /// Writes all records or none, and returns once the disk has them: per session, how many of its samples it has now.
    pub(crate) fn write<'a>(
        &mut self,
        records: impl Iterator<Item = &'a Record> + Clone,
    ) -> Result<Vec<(u64, u64)>, StoreError> {
        for record in records.clone() {
            self.appender.look_at_set(&self.connection, record)?;
        }
        // What is appended to a log that was cut off would hide that.
        self.check_held()?;
        let transaction = self.connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for record in records {
            self.activated |= matches!(record, Record::Activated { .. } | Record::ModelSetDeleted { .. });
            self.erasing |= matches!(record, Record::ModelSetDeleted { .. } | Record::SessionDeleted { .. });
            self.appender.append(&transaction, record)?;
        }
        let grown = self.appender.finish(&transaction)?;
        transaction.commit().map_err(|error| self.take_back(error.into()))?;
        // A commit into a file that nobody finds again is none.
        self.check_held()?;
        Ok(grown)
    }

    /// A commit whose flush failed is in the log with all its pages, where the next start would find what was refused: it is
    /// cut off.
    fn take_back(&self, failed: StoreError) -> StoreError {
        match self.held.as_ref().map_or(Ok(()), |held| held.cut_log(self.log_pages.load(Ordering::Relaxed))) {
            Ok(()) => failed,
            Err(why) => failed.not_taken_back(&why),
        }
    }

    /// Whether the files are those that were opened, as long as it is open.
    fn check_held(&self) -> Result<(), StoreError> {
        self.held.as_ref().map_or(Ok(()), HeldFiles::check)
    }

    /// The samples and ramps of a session, each proven, or why they cannot be trusted.
    pub(crate) fn samples(&self, session: u64) -> Result<SessionSamples, String> {
        session_samples::samples(&self.connection, session)
    }

    /// Proves the samples and ramps of a session and keeps none, or why they cannot be trusted.
    pub(crate) fn prove_samples(&self, session: u64) -> Result<(), String> {
        session_samples::prove(&self.connection, session).map(drop)
    }

    /// The text of a model set as it was written, or why it cannot be had.
    pub(crate) fn set_text(&self, id: &str) -> Result<String, StoreError> {
        let missing = || StoreError::NoModelSet { model_set: id.to_owned() };
        let seq = self.appender.row_of_set(id).ok_or_else(missing)?;
        let text = sets::text(&self.connection, seq)?.ok_or_else(missing)?;
        text.map_err(|findings| StoreError::DamagedModelSet { model_set: id.to_owned(), findings })
    }

    /// Whether all is proven.
    pub(crate) fn is_proven(&self) -> bool {
        self.unproven.is_over()
    }

    /// Proves the next part of what is left. `disturbed` tells whether somebody waits.
    pub(crate) fn prove_next(&mut self, disturbed: impl Fn() -> bool + Send + 'static) -> Step {
        self.unproven.step(&mut self.connection, |id| self.appender.row_of_set(id), disturbed)
    }

    /// Remembers damage: a model set can be written again, and a file that may be damaged is looked at by the next start.
    pub(crate) fn note(&mut self, finding: &Finding) {
        match &finding.lost {
            Lost::ModelSet(id) => self.appender.lose_set(id),
            Lost::Structure => self.doubt(),
            Lost::Samples(_) => {}
        }
    }

    /// The file may be damaged: the next start looks at all of it.
    pub(crate) fn doubt(&self) {
        self.path.iter().for_each(|path| beside::mark_doubt(path));
    }

    /// Entries of the audit log before this number, newest first.
    pub(crate) fn audit(&self, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        Ok(audit_rows::read(&self.connection, before, most)?)
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
        let Some(path) = &self.path else { return Ok(()) };
        let length = fs::metadata(beside::wal(path)).map_or(0, |file| file.len());
        if length > WAL_BYTES_MAX { self.checkpoint() } else { Ok(()) }
    }

    fn checkpoint(&self) -> Result<(), StoreError> {
        self.check_held()?;
        fold_back(&self.connection, self.path.as_deref())?;
        self.log_pages.store(0, Ordering::Relaxed);
        Ok(())
    }

    /// Folds the log back and closes the file.
    pub(crate) fn close(self) -> Result<(), StoreError> {
        let open = self.writable()?;
        open.end_log()?;
        // From here on the log may be missing. A store that is dropped before keeps it, as the mark says.
        open.connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, false)?;
        let Self { connection, lock, .. } = open;
        let closed = connection.close().map_err(|(_, error)| StoreError::from(error));
        drop(lock);
        closed
    }

    /// Folds the log back, and notes that one that is missing from here on is none that was lost. Closing removes it, so that
    /// this comes first: a process that dies between the two must not find a loss.
    fn end_log(&self) -> Result<(), StoreError> {
        let Some(path) = &self.path else { return Ok(()) };
        self.checkpoint()?;
        open_mark::clear(path).map_err(|error| StoreError::changing(&beside::open_mark(path), &error))
    }

    /// Marks the file as open, and from here on how much of its log is on disk.
    fn mark_open(&mut self, path: &Path) -> Result<(), StoreError> {
        let mark = OpenMark::set(path).map_err(|error| StoreError::changing(&beside::open_mark(path), &error))?;
        let log_pages = Arc::clone(&self.log_pages);
        // SQLite calls this after a commit, and a commit flushes the log.
        let noted = move |_: &mut Wal, pages| {
            if let Ok(pages) = u32::try_from(pages) {
                log_pages.store(pages, Ordering::Relaxed);
                mark.note(pages);
            }
            Ok(())
        };
        Ok(self.connection.wal_hook(Some(noted))?)
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

/// Folds the log of the database at `path` back, which is `None` if all is in memory.
fn fold_back(connection: &Connection, path: Option<&Path>) -> Result<(), StoreError> {
    if let Some(path) = path {
        open_mark::folds_back(path).map_err(|error| StoreError::changing(&beside::open_mark(path), &error))?;
    }
    connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))?;
    Ok(())
}
