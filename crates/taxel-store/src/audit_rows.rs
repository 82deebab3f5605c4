//! The audit log's rows: requests, and what came of them. A row is proven when it is read; a start only counts them.

use rusqlite::{Connection, params};
use serde::{Deserialize, Serialize};
use taxel_engine::audit::{Answered, Asked, AuditEntry};

use crate::error::{Quarantined, StoreError};
use crate::rows::audit_checksum;
use crate::tally::{Stream, shortfall};

/// The tables' names, which go into the checksums: a row is no use in the other table.
const REQUESTS: &str = "audit";
const RESULTS: &str = "audit_results";

#[derive(Serialize, Deserialize)]
struct StoredAsked {
    wall_ns: i64,
    who: String,
    role: String,
    transport: String,
    place: String,
    method: String,
    what: String,
    claimed: String,
    patch: String,
    before: String,
}

#[derive(Serialize, Deserialize)]
struct StoredAnswered {
    wall_ns: i64,
    result: String,
    after: String,
}

/// Adds a request.
pub(crate) fn insert_asked(connection: &Connection, seq: u64, asked: &Asked) -> Result<(), StoreError> {
    let asked = asked.clone();
    let stored = StoredAsked {
        wall_ns: asked.wall_ns,
        who: asked.who,
        role: asked.role,
        transport: asked.transport,
        place: asked.place,
        method: asked.method,
        what: asked.what,
        claimed: asked.claimed,
        patch: asked.patch,
        before: asked.before,
    };
    insert(connection, REQUESTS, seq, &stored)
}

/// Adds what came of a request.
pub(crate) fn insert_answered(connection: &Connection, seq: u64, answered: &Answered) -> Result<(), StoreError> {
    let Answered { wall_ns, result, after, .. } = answered.clone();
    insert(connection, RESULTS, seq, &StoredAnswered { wall_ns, result, after })
}

fn insert(connection: &Connection, table: &str, seq: u64, entry: &impl Serialize) -> Result<(), StoreError> {
    let entry = serde_json::to_string(entry).map_err(|error| StoreError::Unstorable {
        what: format!("entry {seq} of the audit log"),
        reason: error.to_string(),
    })?;
    connection
        .prepare_cached(&format!("INSERT INTO {table} (seq, entry, checksum) VALUES (?1, ?2, ?3)"))?
        .execute(params![seq, entry, audit_checksum(table, seq, &entry)])?;
    Ok(())
}

/// Entries with numbers below `before`, at most so many, newest first.
pub(crate) fn read(connection: &Connection, before: u64, most: u32) -> rusqlite::Result<Vec<AuditEntry>> {
    let mut statement = connection.prepare_cached(
        "SELECT audit.seq, audit.entry, audit.checksum, audit_results.entry, audit_results.checksum
         FROM audit LEFT JOIN audit_results USING (seq) WHERE audit.seq < ?1 ORDER BY audit.seq DESC LIMIT ?2",
    )?;
    let before = i64::try_from(before).unwrap_or(i64::MAX);
    let mut rows = statement.query(params![before, most])?;
    let mut entries = Vec::new();
    while let Some(row) = rows.next()? {
        let number: u64 = row.get(0)?;
        let mut entry = AuditEntry { number, ..AuditEntry::default() };
        match proven(REQUESTS, number, row.get(1), row.get(2)) {
            Ok(stored) => entry.asked = Some(asked(stored)),
            Err(reason) => entry.damage = format!("the request: {reason}"),
        }
        if row.get::<_, Option<Vec<u8>>>(4).is_ok_and(|checksum| checksum.is_none()) {
            entries.push(entry);
            continue;
        }
        match proven(RESULTS, number, row.get(3), row.get(4)) {
            Ok(StoredAnswered { wall_ns, result, after }) => {
                entry.answered = Some(Answered { request: 0, wall_ns, result, after });
            }
            Err(reason) => entry.damage = format!("the result: {reason}"),
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn proven<T: for<'a> Deserialize<'a>>(
    table: &str,
    seq: u64,
    entry: rusqlite::Result<String>,
    checksum: rusqlite::Result<Vec<u8>>,
) -> Result<T, String> {
    let (entry, checksum) = (entry.map_err(|e| e.to_string())?, checksum.map_err(|e| e.to_string())?);
    if checksum != audit_checksum(table, seq, &entry) {
        return Err("its checksum is wrong".to_owned());
    }
    serde_json::from_str(&entry).map_err(|error| error.to_string())
}

fn asked(stored: StoredAsked) -> Asked {
    Asked {
        request: 0, // of a run that nobody knows any more
        wall_ns: stored.wall_ns,
        who: stored.who,
        role: stored.role,
        transport: stored.transport,
        place: stored.place,
        method: stored.method,
        what: stored.what,
        claimed: stored.claimed,
        patch: stored.patch,
        before: stored.before,
    }
}

/// Tells if rows of the log are missing.
pub(crate) fn count(connection: &Connection, quarantined: &mut Vec<Quarantined>) -> rusqlite::Result<()> {
    for (stream, table) in [(Stream::Audit, REQUESTS), (Stream::AuditResults, RESULTS)] {
        let rows: u64 = connection.query_row(&format!("SELECT count(*) FROM {table}"), [], |row| row.get(0))?;
        if let Some(reason) = shortfall(connection, stream, rows)? {
            quarantined.push(Quarantined::lost(format!("the audit log ({table})"), reason));
        }
    }
    Ok(())
}
