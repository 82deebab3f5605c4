//! Model sets on disk: listed by their summaries, and read one at a time.

use rusqlite::{Connection, ErrorCode, OptionalExtension, Row, params};
use sha2::{Digest, Sha256};
use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;

use crate::error::{Quarantined, StoreError};
use crate::facts::checksum;
use crate::models_json;
use crate::stored::StoredSummary;

/// How findings name a set.
pub(crate) fn name_of(id: &str) -> String {
    format!("model set {id}")
}

/// Writes a set, unless it is there: the id is the content's hash. One that is damaged is written anew.
pub(crate) fn put(connection: &Connection, set: &ModelSet) -> Result<(), StoreError> {
    let unstorable = |reason: String| StoreError::Unstorable { what: name_of(&set.id), reason };
    if matches!(text(connection, &set.id), Ok(Some(Ok(_)))) {
        return Ok(());
    }
    let json = models_json::to_json(set).map_err(|error| unstorable(error.to_string()))?;
    let summary = serde_json::to_string(&StoredSummary(SetSummary::of(set)));
    let summary = summary.map_err(|error| unstorable(error.to_string()))?;
    let sha256 = Sha256::digest(&json).to_vec();
    let sum = sum_of(&set.id, &summary, &sha256);
    connection.execute(
        "INSERT OR REPLACE INTO model_sets (id, summary, sha256, sum, json) VALUES (?1, ?2, ?3, ?4, ?5)",
        params![set.id, summary, sha256, sum, json.as_bytes()],
    )?;
    Ok(())
}

fn sum_of(id: &str, summary: &str, sha256: &[u8]) -> Vec<u8> {
    checksum(&[b"model set", id.as_bytes(), summary.as_bytes(), sha256])
}

/// What lists show of every set, oldest first. One that is damaged is reported and not listed.
pub(crate) fn list(connection: &Connection, damage: &mut Vec<Quarantined>) -> rusqlite::Result<Vec<SetSummary>> {
    let mut statement = connection.prepare("SELECT id, summary, sha256, sum FROM model_sets ORDER BY seq")?;
    let mut rows = statement.query([])?;
    let mut sets = Vec::new();
    while let Some(row) = rows.next()? {
        let id: String = row.get(0)?;
        match summary(row, &id) {
            Ok(summary) => sets.push(summary),
            Err(reason) => damage.push(Quarantined::new(name_of(&id), reason)),
        }
    }
    Ok(sets)
}

fn summary(row: &Row<'_>, id: &str) -> Result<SetSummary, String> {
    let words = |error: rusqlite::Error| error.to_string();
    let (text, sha256): (String, Vec<u8>) = (row.get(1).map_err(words)?, row.get(2).map_err(words)?);
    if sum_of(id, &text, &sha256) != row.get::<_, Vec<u8>>(3).map_err(words)? {
        return Err("its checksum is wrong".to_owned());
    }
    let StoredSummary(summary) = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    Ok(summary)
}

/// The text of a set as it was written, or why it is not that; nothing if there is no such set.
pub(crate) fn text(connection: &Connection, id: &str) -> rusqlite::Result<Option<Result<String, String>>> {
    let mut statement =
        connection.prepare_cached("SELECT id, summary, sha256, sum, json FROM model_sets WHERE id = ?1")?;
    match statement.query_row([id], |row| Ok(proven_text(row, id))).optional() {
        // A page that is damaged says nothing of the others.
        Err(error) if error.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt) => Ok(Some(Err(error.to_string()))),
        read => read,
    }
}

fn proven_text(row: &Row<'_>, id: &str) -> Result<String, String> {
    summary(row, id)?;
    let words = |error: rusqlite::Error| error.to_string();
    let (sha256, json): (Vec<u8>, Vec<u8>) = (row.get(2).map_err(words)?, row.get(4).map_err(words)?);
    if sha256 != Sha256::digest(&json).to_vec() {
        return Err("its checksum is wrong".to_owned());
    }
    String::from_utf8(json).map_err(|error| error.to_string())
}

/// A set, or why it cannot be had.
pub(crate) fn read(connection: &Connection, id: &str) -> rusqlite::Result<Result<ModelSet, String>> {
    let text = text(connection, id)?.unwrap_or_else(|| Err("it is not there".to_owned()));
    Ok(text.and_then(|text| models_json::from_json(&text).map_err(|error| error.to_string())))
}

/// Deletes a set; whether there was one.
pub(crate) fn delete(connection: &Connection, id: &str) -> rusqlite::Result<bool> {
    Ok(connection.execute("DELETE FROM model_sets WHERE id = ?1", [id])? > 0)
}
