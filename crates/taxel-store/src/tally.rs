//! How many rows each stream of the store ever got, those included that were deleted on purpose: their deletion is a row
//! of another stream, and so a deleted row is told from a lost one.
//!
//! A row proves itself by its checksum; that the last rows of a table are missing, only a number kept elsewhere can
//! tell. It is written in the transaction that adds the rows.

use std::collections::{BTreeSet, HashMap};
use std::fmt;

use rusqlite::{Connection, OptionalExtension, params};

use crate::rows;

/// The streams that are counted.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stream {
    Sessions,
    /// Ramps of one session.
    Ramps(u64),
    /// Samples of one session.
    Samples(u64),
    ModelSets,
    Activations,
    Loads,
    /// Requests of the audit log.
    Audit,
    /// Their results.
    AuditResults,
    /// What is known of the zeros of boards.
    BoardZeros,
    /// Rows that stand for deleted sessions.
    DeletedSessions,
    /// Rows that stand for deleted model sets.
    DeletedModelSets,
}

impl fmt::Display for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sessions => f.write_str("sessions"),
            Self::Ramps(session) => write!(f, "ramps of session {session}"),
            Self::Samples(session) => write!(f, "samples of session {session}"),
            Self::ModelSets => f.write_str("model sets"),
            Self::Activations => f.write_str("activations"),
            Self::Loads => f.write_str("loads"),
            Self::Audit => f.write_str("audit"),
            Self::AuditResults => f.write_str("audit results"),
            Self::BoardZeros => f.write_str("zero doubts"),
            Self::DeletedSessions => f.write_str("deleted sessions"),
            Self::DeletedModelSets => f.write_str("deleted model sets"),
        }
    }
}

/// The numbers that were asked for, and which of them are still to be written.
#[derive(Default)]
pub(crate) struct Tally {
    /// By the stream's name.
    rows: HashMap<String, u64>,
    changed: BTreeSet<String>,
}

impl Tally {
    /// Rows that the stream has.
    pub(crate) fn get(&mut self, connection: &Connection, stream: Stream) -> rusqlite::Result<u64> {
        let name = stream.to_string();
        if let Some(&rows) = self.rows.get(&name) {
            return Ok(rows);
        }
        let rows = connection
            .prepare_cached("SELECT rows FROM tally WHERE stream = ?1")?
            .query_row([&name], |row| row.get(0))
            .optional()?
            .unwrap_or(0);
        self.rows.insert(name, rows);
        Ok(rows)
    }

    /// The stream has so many now.
    pub(crate) fn set(&mut self, stream: Stream, rows: u64) {
        let name = stream.to_string();
        self.rows.insert(name.clone(), rows);
        self.changed.insert(name);
    }

    /// The stream is gone with what it belonged to.
    pub(crate) fn forget(&mut self, connection: &Connection, stream: Stream) -> rusqlite::Result<()> {
        let name = stream.to_string();
        self.rows.remove(&name);
        self.changed.remove(&name);
        connection.execute("DELETE FROM tally WHERE stream = ?1", [&name]).map(|_| ())
    }

    /// Writes what has changed.
    pub(crate) fn save(&mut self, connection: &Connection) -> rusqlite::Result<()> {
        let mut statement = connection.prepare_cached(
            "INSERT INTO tally (stream, rows, checksum) VALUES (?1, ?2, ?3)
             ON CONFLICT (stream) DO UPDATE SET rows = excluded.rows, checksum = excluded.checksum",
        )?;
        for name in std::mem::take(&mut self.changed) {
            let rows = self.rows.get(&name).copied().unwrap_or(0);
            statement.execute(params![name, rows, rows::tally_checksum(&name, rows)])?;
        }
        Ok(())
    }
}

/// Whether there is a record of how many rows a stream got: there is none before the first one, and none if it is lost.
pub(crate) fn is_recorded(connection: &Connection, stream: Stream) -> rusqlite::Result<bool> {
    let there = "SELECT EXISTS (SELECT 1 FROM tally WHERE stream = ?1)";
    connection.query_row(there, [stream.to_string()], |row| row.get(0))
}

/// How many rows a stream got; `None` if the record of it is damaged.
pub(crate) fn written(connection: &Connection, stream: Stream) -> rusqlite::Result<Option<u64>> {
    let name = stream.to_string();
    let mut statement = connection.prepare_cached("SELECT rows, checksum FROM tally WHERE stream = ?1")?;
    let mut found = statement.query([&name])?;
    let Some(row) = found.next()? else { return Ok(Some(0)) };
    Ok(match (row.get::<_, u64>(0), row.get::<_, Vec<u8>>(1)) {
        (Ok(written), Ok(checksum)) if checksum == rows::tally_checksum(&name, written) => Some(written),
        _ => None,
    })
}

/// Why a stream of which a start found `rows` rows is not whole; `None` if it is.
pub(crate) fn shortfall(connection: &Connection, stream: Stream, rows: u64) -> rusqlite::Result<Option<String>> {
    Ok(match written(connection, stream)? {
        None => Some("the record of how many there were is damaged".to_owned()),
        Some(written) if written == rows => None,
        Some(written) => Some(format!("{written} were written, {rows} are there")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_recorded_once_its_number_is_written_and_until_it_is_forgotten() {
        let connection = Connection::open_in_memory().unwrap();
        connection.execute_batch("CREATE TABLE tally (stream TEXT PRIMARY KEY, rows, checksum)").unwrap();
        let mut tally = Tally::default();
        tally.set(Stream::BoardZeros, 3);
        assert!(!is_recorded(&connection, Stream::BoardZeros).unwrap(), "it is not written yet");
        tally.save(&connection).unwrap();
        assert!(is_recorded(&connection, Stream::BoardZeros).unwrap());
        assert!(!is_recorded(&connection, Stream::Audit).unwrap());
        assert_eq!(written(&connection, Stream::BoardZeros).unwrap(), Some(3));
        tally.forget(&connection, Stream::BoardZeros).unwrap();
        assert!(!is_recorded(&connection, Stream::BoardZeros).unwrap());
    }
}
