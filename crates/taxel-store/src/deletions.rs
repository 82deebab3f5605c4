//! The rows that stand for what was deleted: by them a start tells deleted from lost.

use std::collections::{BTreeMap, BTreeSet};

use rusqlite::{Connection, Row};

use crate::error::Quarantined;
use crate::rows;
use crate::tally::{Stream, shortfall};

/// Everything that was deleted.
#[derive(Debug, Default)]
pub(crate) struct Deletions {
    /// Numbers of sessions, also from rows that are damaged: no number is ever used again.
    sessions: BTreeSet<u64>,
    /// Rows that model sets had, also from rows that are damaged.
    rows_of_sets: BTreeSet<u64>,
    /// By the id of a model set: the newest activation of all when it was deleted.
    activations: BTreeMap<String, u64>,
}

impl Deletions {
    /// Reads and proves them. One that is damaged is reported; the row that it stood for is gone all the same.
    pub(crate) fn read(connection: &Connection, quarantined: &mut Vec<Quarantined>) -> rusqlite::Result<Self> {
        let mut found = Self::default();
        let mut statement = connection.prepare("SELECT number, wall_ns, checksum FROM deleted_sessions")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let number = row.get(0)?;
            found.sessions.insert(number);
            if let Err(reason) = session(row, number) {
                quarantined.push(Quarantined::new(format!("the deletion of session {number}"), reason));
            }
        }
        let mut statement =
            connection.prepare("SELECT seq, id, activation, wall_ns, checksum FROM deleted_model_sets ORDER BY seq")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let seq = row.get(0)?;
            found.rows_of_sets.insert(seq);
            match model_set(row, seq) {
                Ok((id, activation)) => {
                    found.activations.insert(id, activation);
                }
                Err(reason) => {
                    quarantined.push(Quarantined::new(format!("the deletion of the model set in row {seq}"), reason));
                }
            }
        }
        let streams = [
            (Stream::DeletedSessions, found.sessions.len(), "the list of deleted sessions"),
            (Stream::DeletedModelSets, found.rows_of_sets.len(), "the list of deleted model sets"),
        ];
        for (stream, rows, what) in streams {
            let reason = shortfall(connection, stream, rows as u64)?;
            quarantined.extend(reason.map(|reason| Quarantined::lost(what, reason)));
        }
        Ok(found)
    }

    /// How many sessions were deleted.
    pub(crate) fn sessions(&self) -> u64 {
        self.sessions.len() as u64
    }

    /// The highest number of them; 0 if there is none.
    pub(crate) fn newest_session(&self) -> u64 {
        self.sessions.last().copied().unwrap_or(0)
    }

    /// The rows that deleted model sets had.
    pub(crate) fn rows_of_sets(&self) -> BTreeSet<u64> {
        self.rows_of_sets.clone()
    }

    /// Whether a model set was deleted after this activation of it.
    pub(crate) fn ended(&self, id: &str, activation: u64) -> bool {
        self.activations.get(id).is_some_and(|&deleted| activation <= deleted)
    }
}

fn session(row: &Row<'_>, number: u64) -> Result<(), String> {
    let (wall_ns, checksum): (i64, Vec<u8>) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    proven(checksum == rows::deleted_session_checksum(number, wall_ns))
}

fn model_set(row: &Row<'_>, seq: u64) -> Result<(String, u64), String> {
    let (id, activation): (String, u64) = (row.get(1).map_err(text)?, row.get(2).map_err(text)?);
    let (wall_ns, checksum): (i64, Vec<u8>) = (row.get(3).map_err(text)?, row.get(4).map_err(text)?);
    proven(checksum == rows::deleted_set_checksum(seq, &id, activation, wall_ns))?;
    Ok((id, activation))
}

fn proven(is_right: bool) -> Result<(), String> {
    if is_right { Ok(()) } else { Err("its checksum is wrong".to_owned()) }
}

fn text(error: rusqlite::Error) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_of_deleted_sessions_is_the_highest_number() {
        assert_eq!(Deletions::default().newest_session(), 0);
        let some = Deletions { sessions: [9, 2].into(), ..Deletions::default() };
        assert_eq!((some.newest_session(), some.sessions()), (9, 2));
    }

    #[test]
    fn a_row_whose_columns_are_of_another_type_says_so() {
        let connection = rusqlite::Connection::open_in_memory().unwrap();
        let mut row = connection.prepare("SELECT 1, 'no time', x'00', 'no time', x'00'").unwrap();
        let mut rows = row.query([]).unwrap();
        let row = rows.next().unwrap().unwrap();
        let said = [session(row, 1).unwrap_err(), model_set(row, 1).unwrap_err()];
        assert!(said.iter().all(|said| said.contains("Invalid column type")), "{said:?}");
    }
}
