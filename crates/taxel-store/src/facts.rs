//! Facts: rows of text, each proven by its checksum. All but the texts of model sets are JSON of one type.

use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::error::StoreError;

/// Which fact: its kind, and what tells it from others of that kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Key<'a> {
    pub(crate) kind: &'static str,
    pub(crate) name: &'a str,
    pub(crate) number: u64,
}

impl<'a> Key<'a> {
    /// Facts that are numbered.
    pub(crate) const fn numbered(kind: &'static str, number: u64) -> Self {
        Self { kind, name: "", number }
    }

    /// Facts that have a name.
    pub(crate) const fn named(kind: &'static str, name: &'a str) -> Self {
        Self { kind, name, number: 0 }
    }
}

/// A row, and what it says or why it is invalid.
#[derive(Debug)]
pub(crate) struct Found<T> {
    pub(crate) name: String,
    pub(crate) number: u64,
    pub(crate) fact: Result<T, String>,
}

/// Bytes of a row's checksum: enough against chance.
const SUM_BYTES: usize = 8;

/// The first bytes of the SHA-256 of the parts, each preceded by its length so that bytes cannot move between them.
pub(crate) fn checksum(parts: &[&[u8]]) -> Vec<u8> {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize()[..SUM_BYTES].to_vec()
}

fn sum_of(key: Key<'_>, body: &str) -> Vec<u8> {
    checksum(&[key.kind.as_bytes(), key.name.as_bytes(), &key.number.to_le_bytes(), body.as_bytes()])
}

/// Writes a fact, in place of one with the same key.
pub(crate) fn put(connection: &Connection, key: Key<'_>, fact: &impl Serialize) -> Result<(), StoreError> {
    let body = serde_json::to_string(fact).map_err(|error| StoreError::Unstorable {
        what: format!("{} {}{}", key.kind, key.name, key.number),
        reason: error.to_string(),
    })?;
    put_text(connection, key, &body)
}

/// Writes a fact that is a text.
pub(crate) fn put_text(connection: &Connection, key: Key<'_>, body: &str) -> Result<(), StoreError> {
    connection
        .prepare_cached("INSERT OR REPLACE INTO facts (kind, name, number, body, sum) VALUES (?1, ?2, ?3, ?4, ?5)")?
        .execute(params![key.kind, key.name, key.number, body, sum_of(key, body)])?;
    Ok(())
}

/// The fact with this key; nothing if there is none.
pub(crate) fn get<T: DeserializeOwned>(
    connection: &Connection,
    key: Key<'_>,
) -> rusqlite::Result<Option<Result<T, String>>> {
    Ok(get_text(connection, key)?.map(|text| parsed(text)))
}

/// The text with this key; nothing if there is none.
pub(crate) fn get_text(connection: &Connection, key: Key<'_>) -> rusqlite::Result<Option<Result<String, String>>> {
    connection
        .prepare_cached("SELECT body, sum FROM facts WHERE kind = ?1 AND name = ?2 AND number = ?3")?
        .query_row(params![key.kind, key.name, key.number], |row| Ok(proven(key, row)))
        .optional()
}

/// All facts of a kind, in the order of their names and numbers.
pub(crate) fn all<T: DeserializeOwned>(connection: &Connection, kind: &'static str) -> rusqlite::Result<Vec<Found<T>>> {
    let mut statement =
        connection.prepare_cached("SELECT body, sum, name, number FROM facts WHERE kind = ?1 ORDER BY name, number")?;
    let found = statement.query_map([kind], |row| {
        let (name, number): (String, u64) = (row.get(2)?, row.get(3)?);
        let fact = parsed(proven(Key { kind, name: &name, number }, row));
        Ok(Found { name, number, fact })
    })?;
    found.collect()
}

/// Deletes a fact; whether there was one.
pub(crate) fn delete(connection: &Connection, key: Key<'_>) -> rusqlite::Result<bool> {
    let mut statement = connection.prepare_cached("DELETE FROM facts WHERE kind = ?1 AND name = ?2 AND number = ?3")?;
    Ok(statement.execute(params![key.kind, key.name, key.number])? > 0)
}

/// Deletes all facts of a kind with this name.
pub(crate) fn delete_all(connection: &Connection, kind: &str, name: &str) -> rusqlite::Result<()> {
    connection.execute("DELETE FROM facts WHERE kind = ?1 AND name = ?2", [kind, name]).map(drop)
}

fn proven(key: Key<'_>, row: &Row<'_>) -> Result<String, String> {
    let (body, sum): (String, Vec<u8>) =
        row.get(0).and_then(|body| Ok((body, row.get(1)?))).map_err(|error| error.to_string())?;
    if sum == sum_of(key, &body) { Ok(body) } else { Err("its checksum is wrong".to_owned()) }
}

fn parsed<T: DeserializeOwned>(text: Result<String, String>) -> Result<T, String> {
    serde_json::from_str(&text?).map_err(|error| error.to_string())
}
