//! The audit log: requests, and what came of them. A request without a result is one that the daemon did not live to answer.

use rusqlite::{Connection, params};
use taxel_engine::audit::{Answered, Asked, AuditEntry};

use crate::error::StoreError;
use crate::facts::{self, Key};

/// The kinds of facts that they are, by the number of the entry.
const ASKED: &str = "asked";
const ANSWERED: &str = "answered";

/// Most entries that are read at a time: commits wait so long.
const ENTRIES_MAX: u32 = 1000;

/// Adds a request. Gives the number of its entry.
pub(crate) fn put_asked(connection: &Connection, asked: &Asked) -> Result<u64, StoreError> {
    let newest = "SELECT coalesce(max(number), 0) FROM facts WHERE kind = ?1 AND name = ''";
    let newest: u64 = connection.prepare_cached(newest)?.query_row([ASKED], |row| row.get(0))?;
    facts::put(connection, Key::numbered(ASKED, newest + 1), asked)?;
    Ok(newest + 1)
}

/// Adds what came of the request of an entry.
pub(crate) fn put_answered(connection: &Connection, entry: u64, answered: &Answered) -> Result<(), StoreError> {
    facts::put(connection, Key::numbered(ANSWERED, entry), answered)
}

/// Entries with numbers below `before`, at most so many, newest first.
pub(crate) fn read(connection: &Connection, before: u64, most: u32) -> rusqlite::Result<Vec<AuditEntry>> {
    let mut statement = connection.prepare_cached(
        "SELECT number FROM facts WHERE kind = ?1 AND name = '' AND number < ?2 ORDER BY number DESC LIMIT ?3",
    )?;
    let before = i64::try_from(before).unwrap_or(i64::MAX);
    let numbers = statement.query_map(params![ASKED, before, most.min(ENTRIES_MAX)], |row| row.get(0))?;
    numbers.map(|number| entry(connection, number?)).collect()
}

fn entry(connection: &Connection, number: u64) -> rusqlite::Result<AuditEntry> {
    let asked = facts::get(connection, Key::numbered(ASKED, number))?.transpose();
    let answered = facts::get(connection, Key::numbered(ANSWERED, number))?.transpose();
    let damage = |what: &str, why: Option<&String>| why.map(|why| format!("the {what}: {why}"));
    let damage = [damage("request", asked.as_ref().err()), damage("result", answered.as_ref().err())];
    let damage = damage.into_iter().flatten().collect::<Vec<_>>().join("; ");
    Ok(AuditEntry { number, asked: asked.ok().flatten(), answered: answered.ok().flatten(), damage })
}
