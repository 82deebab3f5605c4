//! The copy of a store, beside it: the newest one that is whole takes the place of a database that is damaged, lost or older.
//!
//! It is made by SQLite after a model set came into use, a session ended, or something was deleted. Until it is whole it has
//! another name, so that after a power cut the one before is there.

use std::path::{Path, PathBuf};

use rusqlite::Connection;
use rusqlite::backup::{Backup, StepResult};

use crate::connect;
use crate::error::StoreError;
use crate::facts;
use crate::files::{self, COPY, COPY_PART, NEW, beside};
use crate::restore::{self, Found, GENERATION, OPEN};
use crate::schema;
use crate::stored::StoredZeros;

/// So many pages of 4 KiB are copied before commits have their turn again.
const PAGES_AT_A_TIME: i32 = 256;

/// A copy that is being made of a database.
pub(crate) struct Copying<'a> {
    backup: Backup<'a, 'a>,
}

/// Where a copy is made, until it is whole.
pub(crate) struct Part {
    database: PathBuf,
    part: PathBuf,
    connection: Connection,
}

impl Part {
    pub(crate) fn make(database: &Path) -> Result<Self, StoreError> {
        let part = beside(database, COPY_PART);
        files::make_new(&part, database).map_err(|error| StoreError::changing(&part, &error))?;
        let connection = Connection::open(&part)?;
        without_journal(&connection)?;
        Ok(Self { database: database.to_path_buf(), part, connection })
    }

    /// Begins to copy; what is committed meanwhile is in the copy as well.
    pub(crate) fn begin<'a>(&'a mut self, from: &'a Connection) -> Result<Copying<'a>, StoreError> {
        Ok(Copying { backup: Backup::new(from, &mut self.connection)? })
    }

    /// Has the copy take the place of the one before.
    pub(crate) fn finish(self) -> Result<(), StoreError> {
        let Self { database, part, connection } = self;
        connection.pragma_update_and_check(None, "journal_mode", "delete", |_| Ok(()))?;
        without_journal(&connection)?;
        // Nobody has it open, so that none of its log is missed.
        facts::put(&connection, OPEN, &false)?;
        connection.close().map_err(|(_, error)| StoreError::from(error))?;
        files::put_in_place(&part, &beside(&database, COPY))
    }
}

/// What is lost with a file that is being made was never there.
fn without_journal(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "synchronous", "off")?;
    connection.pragma_update_and_check(None, "journal_mode", "off", |_| Ok(()))
}

impl Copying<'_> {
    /// Copies some more; whether that was the last of it.
    pub(crate) fn step(&self) -> Result<bool, StoreError> {
        Ok(matches!(self.backup.step(PAGES_AT_A_TIME)?, StepResult::Done))
    }
}

/// What the copy of a store holds; nothing if there is none, or why it cannot be used.
pub(crate) fn read(database: &Path) -> Result<Option<Found>, StoreError> {
    let copy = beside(database, COPY);
    if !copy.exists() {
        return Ok(None);
    }
    let connection = open(&copy)?;
    restore::read(&connection).map(Some)
}

/// Opens the copy of a store, which is proven to be whole.
pub(crate) fn open(copy: &Path) -> Result<Connection, StoreError> {
    let connection = connect::to_read(copy)?;
    connect::check(&connection, copy)?;
    Ok(connection)
}

/// Makes a database of the copy, or an empty one, and puts it in the place of what is there, which is set aside. Every zero
/// that it knows of needs confirmation. Gives the name of what was set aside.
pub(crate) fn take_its_place(path: &Path, copy: bool) -> Result<Option<PathBuf>, StoreError> {
    let new = beside(path, NEW);
    let there = path.symlink_metadata().is_ok() || beside(path, files::LOG).symlink_metadata().is_ok();
    files::make_new(&new, path).map_err(|error| StoreError::changing(&new, &error))?;
    let mut connection = Connection::open(&new)?;
    without_journal(&connection)?;
    if copy {
        let from = open(&beside(path, COPY))?;
        Backup::new(&from, &mut connection)?.step(-1)?;
    }
    schema::bring_up_to_date(&mut connection)?;
    if copy {
        doubt_zeros(&connection)?;
    } else {
        facts::put(&connection, GENERATION, &0)?;
        facts::put(&connection, restore::NEXT_SESSION, &1)?;
        facts::put(&connection, OPEN, &false)?;
    }
    connection.close().map_err(|(_, error)| StoreError::from(error))?;
    let aside = if there { Some(files::set_aside(path)?) } else { None };
    files::put_in_place(&new, path)?;
    Ok(aside)
}

/// Writes down that every zero of a database needs confirmation.
pub(crate) fn doubt_zeros(connection: &Connection) -> Result<(), StoreError> {
    let Found { mut restored, generation, .. } = restore::read(connection)?;
    restore::doubt_zeros(&mut restored);
    for (patch, zeros) in &restored.board_zeros {
        facts::put(connection, facts::Key::named(restore::ZEROS, patch), &StoredZeros::of(zeros))?;
    }
    facts::put(connection, GENERATION, &(generation + 1))
}
