//! Model sets on disk: two facts each, what lists show of it and its text, which is read when somebody needs it.

use rusqlite::{Connection, ErrorCode};
use taxel_engine::known_set::SetSummary;
use taxel_engine::model_set::ModelSet;

use crate::error::{Quarantined, StoreError};
use crate::facts::{self, Key};
use crate::models_json;

/// The kinds of these facts. A summary has the set's position in the list for its number.
const SUMMARY: &str = "summary";
const TEXT: &str = "model set";

/// How findings name a set.
pub(crate) fn name_of(id: &str) -> String {
    format!("model set {id}")
}

/// Writes a set, unless it is there: the id is the content's hash. One that is damaged is written anew.
pub(crate) fn put(connection: &Connection, set: &ModelSet) -> Result<(), StoreError> {
    if matches!(text(connection, &set.id), Ok(Some(Ok(_)))) {
        return Ok(());
    }
    let unstorable = |error: models_json::ModelsJsonError| StoreError::Unstorable {
        what: name_of(&set.id),
        reason: error.to_string(),
    };
    let json = models_json::to_json(set).map_err(unstorable)?;
    delete(connection, &set.id)?;
    let newest = facts::all::<SetSummary>(connection, SUMMARY)?.iter().map(|row| row.number).max();
    let number = newest.map_or(1, |newest| newest + 1);
    facts::put(connection, Key { kind: SUMMARY, name: &set.id, number }, &SetSummary::of(set))?;
    facts::put_text(connection, Key::named(TEXT, &set.id), &json)
}

/// What lists show of every set, oldest first. One that is damaged is reported and not listed.
pub(crate) fn list(connection: &Connection, damage: &mut Vec<Quarantined>) -> rusqlite::Result<Vec<SetSummary>> {
    let mut rows = facts::all::<SetSummary>(connection, SUMMARY)?;
    rows.sort_by_key(|row| row.number);
    let mut report = |row: facts::Found<SetSummary>| {
        row.fact.map_err(|why| damage.push(Quarantined::new(name_of(&row.name), why))).ok()
    };
    Ok(rows.into_iter().filter_map(&mut report).collect())
}

/// The text of a set as it was written, or why it is not that; nothing if there is no such set.
pub(crate) fn text(connection: &Connection, id: &str) -> rusqlite::Result<Option<Result<String, String>>> {
    match facts::get_text(connection, Key::named(TEXT, id)) {
        // A page that is damaged says nothing of the others.
        Err(error) if error.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt) => Ok(Some(Err(error.to_string()))),
        read => read,
    }
}

/// A set, or why it cannot be had.
pub(crate) fn read(connection: &Connection, id: &str) -> rusqlite::Result<Result<ModelSet, String>> {
    let text = text(connection, id)?.unwrap_or_else(|| Err("it is not there".to_owned()));
    Ok(text.and_then(|text| models_json::from_json(&text).map_err(|error| error.to_string())))
}

/// Deletes a set; whether there was one.
pub(crate) fn delete(connection: &Connection, id: &str) -> rusqlite::Result<bool> {
    facts::delete_all(connection, SUMMARY, id)?;
    facts::delete(connection, Key::named(TEXT, id))
}
