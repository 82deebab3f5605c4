//! An open database, and what must be known of it between transactions.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use rusqlite::{Connection, Transaction, TransactionBehavior};

use crate::error::StoreError;
use crate::facts;
use crate::lock::StoreLock;
use crate::restore::{self, Found, GENERATION, OPEN};
use crate::watch::Watch;
use crate::{connect, copy, schema};

/// The connection and what it must remember.
pub(crate) struct Db {
    pub(crate) connection: Connection,
    pub(crate) state: State,
    /// That this process alone has the store; it is let go after the connection is closed.
    pub(crate) lock: Option<StoreLock>,
}

/// What must be remembered beside the connection, which a copy that is being made holds.
#[derive(Default)]
pub(crate) struct State {
    /// The file; `None` if all is in memory.
    pub(crate) path: Option<PathBuf>,
    /// The files that are open; `None` where nothing is written to any.
    pub(crate) watch: Option<Watch>,
    /// The first failure of a change, after which nothing is tried again: once a flush has failed, the kernel may have dropped
    /// what it could not write, and a second flush would succeed without it.
    pub(crate) failure: Option<StoreError>,
    /// How many commits the file has had.
    pub(crate) generation: u64,
    /// How many samples each session has, and so which comes next.
    pub(crate) samples: BTreeMap<u64, u64>,
    /// Requests of this run that have no result yet: their entries, by their numbers in the run.
    pub(crate) asked: HashMap<u64, u64>,
    /// Something was deleted that the log or the copy still holds.
    pub(crate) erasing: bool,
    /// Something was written that the copy has to have.
    pub(crate) copy_due: bool,
}

impl Db {
    /// A store that ends with the process.
    pub(crate) fn in_memory() -> Result<Self, StoreError> {
        let mut connection = Connection::open_in_memory()?;
        copy::make_empty(&mut connection)?;
        Ok(Self { connection, state: State::default(), lock: None })
    }

    /// Writes down that it is open, and that every zero needs confirmation if that is `required`. The log is folded back, so
    /// that the file alone says so.
    pub(crate) fn begin(&mut self, path: &Path, required: bool) -> Result<(), StoreError> {
        schema::use_log(&self.connection)?;
        let transaction = Transaction::new_unchecked(&self.connection, TransactionBehavior::Immediate)?;
        if required {
            copy::require_confirmation(&transaction)?;
        }
        facts::put(&transaction, OPEN, &true)?;
        self.state.generation = restore::state(&transaction, GENERATION)?;
        transaction.commit()?;
        self.state.fold_log(&self.connection)?;
        self.state.watch = Some(Watch::of(path)?);
        Ok(())
    }

    /// Folds the log back and closes the file.
    ///
    /// # Errors
    /// The first failure of this store, if there was one: what came after it is not on disk.
    pub(crate) fn close(mut self) -> Result<(), StoreError> {
        if let Some(failure) = self.state.failure {
            return Err(failure);
        }
        if self.state.path.is_some() {
            self.state.check()?;
            facts::put(&self.connection, OPEN, &false)?;
            // Closing removes the log. A process that dies before finds both, or a file that says that it has none.
            self.state.fold_log(&self.connection)?;
        }
        connect::close(self.connection)
    }
}

impl State {
    pub(crate) fn of(found: &Found, path: &Path) -> Self {
        let (generation, samples) = (found.generation, found.samples.clone());
        Self { path: Some(path.to_path_buf()), generation, samples, ..Self::default() }
    }

    pub(crate) fn check(&self) -> Result<(), StoreError> {
        self.watch.as_ref().map_or(Ok(()), Watch::check)
    }

    /// Folds the write-ahead log back if it is long, or holds what was deleted.
    ///
    /// SQLite would do so by itself, but it ignores an error there and tries again later; after a failed flush the kernel may
    /// have dropped the pages and call the second try a success. Here the error is seen and is final.
    pub(crate) fn tidy_log(&mut self, connection: &Connection) -> Result<(), StoreError> {
        let erasing = std::mem::take(&mut self.erasing);
        let is_long = self.watch.as_ref().is_some_and(|watch| watch.log_bytes() > schema::LOG_BYTES_MAX);
        if erasing || is_long { self.fold_log(connection) } else { Ok(()) }
    }

    /// Folds the log back.
    pub(crate) fn fold_log(&mut self, connection: &Connection) -> Result<(), StoreError> {
        if self.path.is_none() {
            return Ok(());
        }
        self.check()?;
        connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))?;
        self.watch.as_mut().map_or(Ok(()), Watch::folded)
    }
}
