//! The copy of a store, beside it: the newest one that is whole takes the place of a database that is damaged, lost or older.
//!
//! It is made by SQLite after a model set came into use, a session ended, or something was deleted. Until it is whole it has
//! another name, so that after a power cut the one before is there.

use std::path::{Path, PathBuf};

use rusqlite::Connection;
use rusqlite::backup::Backup;

use crate::connect;
use crate::error::StoreError;
use crate::facts::{self, Key};
use crate::files::{self, COPY, COPY_PART, NEW, beside};
use crate::restore::{self, Found, GENERATION, NEXT_SESSION, OPEN, ZEROS};
use crate::schema;

/// So many pages of 4 KiB are copied before commits have their turn again.
pub(crate) const PAGES_AT_A_TIME: i32 = 256;

/// A file of this database's, to be filled. What is lost with it was never there, so that nothing is flushed.
fn new(database: &Path, suffix: &str) -> Result<Connection, StoreError> {
    let path = beside(database, suffix);
    files::make_new(&path, database)?;
    let connection = Connection::open(&path)?;
    without_journal(&connection)?;
    Ok(connection)
}

fn without_journal(connection: &Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "synchronous", "off")?;
    connection.pragma_update_and_check(None, "journal_mode", "off", |_| Ok(()))
}

/// Where a copy is made, until it is whole.
pub(crate) fn begin(database: &Path) -> Result<Connection, StoreError> {
    new(database, COPY_PART)
}

/// Has the copy that is whole take the place of the one before.
pub(crate) fn finish(part: Connection, database: &Path) -> Result<(), StoreError> {
    part.pragma_update_and_check(None, "journal_mode", "delete", |_| Ok(()))?;
    without_journal(&part)?;
    // Nobody has it open, so that none of its log is missed.
    facts::put(&part, OPEN, &false)?;
    part.close().map_err(|(_, error)| StoreError::from(error))?;
    files::put_in_place(&beside(database, COPY_PART), &beside(database, COPY))
}

/// What the copy of a store holds; nothing if there is none, or why it cannot be used.
pub(crate) fn read(database: &Path) -> Result<Option<Found>, StoreError> {
    let copy = beside(database, COPY);
    if !copy.exists() {
        return Ok(None);
    }
    restore::read(&connect::to_read(&copy)?).map(Some)
}

/// Makes a database of the copy, or an empty one, and puts it in the place of what is there, which is set aside. Every zero
/// that it knows of needs confirmation. Gives the name of what was set aside.
pub(crate) fn take_its_place(path: &Path, copy: bool) -> Result<Option<PathBuf>, StoreError> {
    let there = path.symlink_metadata().is_ok() || beside(path, files::LOG).symlink_metadata().is_ok();
    let mut connection = new(path, NEW)?;
    if copy {
        let from = connect::to_read(&beside(path, COPY))?;
        Backup::new(&from, &mut connection)?.step(-1)?;
        schema::bring_up_to_date(&mut connection)?;
        require_confirmation(&connection)?;
    } else {
        make_empty(&mut connection)?;
    }
    connection.close().map_err(|(_, error)| StoreError::from(error))?;
    let aside = if there { Some(files::set_aside(path)?) } else { None };
    files::put_in_place(&beside(path, NEW), path)?;
    Ok(aside)
}

/// Makes an empty store of a database without tables.
pub(crate) fn make_empty(connection: &mut Connection) -> Result<(), StoreError> {
    schema::bring_up_to_date(connection)?;
    facts::put(connection, GENERATION, &0)?;
    facts::put(connection, NEXT_SESSION, &1)?;
    facts::put(connection, OPEN, &false)
}

/// Writes down that every zero of a database needs confirmation.
pub(crate) fn require_confirmation(connection: &Connection) -> Result<(), StoreError> {
    let Found { mut restored, generation, .. } = restore::read(connection)?;
    restore::require_confirmation(&mut restored);
    for (patch, zero) in &restored.zeros {
        facts::put(connection, Key::named(ZEROS, patch), zero)?;
    }
    facts::put(connection, GENERATION, &(generation + 1))
}
