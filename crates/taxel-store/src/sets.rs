//! The model sets on disk: listed by the small rows of an index, and read one at a time.
//!
//! A row of the index belongs to one text: its checksum has the text's hash in it. So a list needs no text, and an index
//! that is missing, as in files of earlier versions, or damaged is made again from the texts.

use std::collections::{BTreeMap, BTreeSet};

use rusqlite::{Connection, OptionalExtension, Row, params};
use serde::{Deserialize, Serialize};
use taxel_engine::known_set::{KnownSet, SetSummary};
use taxel_engine::model_set::ModelSet;

use crate::deletions::Deletions;
use crate::error::Quarantined;
use crate::models_json;
use crate::models_json::limits::check_length;
use crate::rows;
use crate::tally::{Stream, shortfall};

/// A [`SetSummary`] by the names that the index uses.
#[derive(Serialize, Deserialize)]
struct StoredSummary {
    id: String,
    patch: String,
    made_wall_ns: i64,
    session: Option<u64>,
    method: String,
    taxels: usize,
    calibrated: usize,
    pressure_max_kpa: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    origins: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recalibration_gain: Option<f64>,
}

/// A set that is on disk, and its row.
pub(crate) struct Listed {
    pub(crate) seq: u64,
    pub(crate) known: KnownSet,
}

/// All sets that are on disk, oldest first.
pub(crate) struct List {
    pub(crate) sets: Vec<Listed>,
    /// How many texts were read for it.
    pub(crate) texts_read: usize,
    /// What the index lacks.
    pub(crate) to_index: Vec<ToIndex>,
}

/// A row that the index lacks: that of the set, the hash of its text, and what lists show of it.
pub(crate) type ToIndex = (u64, Vec<u8>, SetSummary);

/// A row, without its text.
struct Entry {
    seq: u64,
    id: String,
    sha256: Vec<u8>,
    /// What the index says, if it is to be believed.
    summary: Option<SetSummary>,
}

/// Writes the index row of a set's row.
pub(crate) fn index(connection: &Connection, seq: u64, sha256: &[u8], summary: &SetSummary) -> rusqlite::Result<()> {
    let text = summary_to_text(summary);
    connection
        .prepare_cached("INSERT OR REPLACE INTO set_index (seq, entry, checksum) VALUES (?1, ?2, ?3)")?
        .execute(params![seq, text, rows::index_checksum(seq, sha256, &text)])
        .map(|_| ())
}

fn summary_to_text(summary: &SetSummary) -> String {
    let summary = summary.clone();
    let stored = StoredSummary {
        id: summary.id,
        patch: summary.patch,
        made_wall_ns: summary.created_wall_ns,
        session: summary.session,
        method: summary.method,
        taxels: summary.taxels,
        calibrated: summary.calibrated,
        pressure_max_kpa: summary.pressure_max_kpa,
        origins: summary.origins,
        recalibration_gain: summary.recalibration_gain,
    };
    serde_json::to_string(&stored).unwrap_or_default() // strings and numbers have one always
}

fn summary_from_text(text: &str) -> Option<SetSummary> {
    let stored: StoredSummary = serde_json::from_str(text).ok()?;
    Some(SetSummary {
        id: stored.id,
        patch: stored.patch,
        created_wall_ns: stored.made_wall_ns,
        session: stored.session,
        method: stored.method,
        taxels: stored.taxels,
        calibrated: stored.calibrated,
        pressure_max_kpa: stored.pressure_max_kpa,
        origins: stored.origins,
        recalibration_gain: stored.recalibration_gain,
    })
}

/// Lists the sets. Texts are read where the index does not do, where two rows have the same id, of which one may be damaged,
/// and all of them if `whole`.
pub(crate) fn list(
    connection: &Connection,
    deletions: &Deletions,
    whole: bool,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<List> {
    let (entries, without_index) = entries(connection, deletions, quarantined)?;
    if without_index > 0 {
        tracing::info!(model_sets = without_index, "model sets without an index row are read, once");
    }
    let mut rows_of: BTreeMap<&str, usize> = BTreeMap::new();
    entries.iter().for_each(|entry| *rows_of.entry(&entry.id).or_default() += 1);
    let mut list = List { sets: Vec::new(), texts_read: 0, to_index: Vec::new() };
    let mut there = BTreeSet::new();
    for entry in &entries {
        let Entry { seq, id, sha256, summary } = entry;
        let is_alone = rows_of.get(id.as_str()) == Some(&1);
        let proven = match summary {
            Some(summary) if is_alone && !whole => Ok(summary.clone()),
            known => {
                list.texts_read += 1;
                summary_of(connection, *seq, id, known.as_ref())?
            }
        };
        match proven {
            Err(reason) => quarantined.push(Quarantined::new(format!("model set {id}"), reason)),
            Ok(proven) => {
                if summary.is_none() {
                    list.to_index.push((*seq, sha256.clone(), proven.clone()));
                }
                if there.insert(id) {
                    list.sets.push(Listed { seq: *seq, known: KnownSet::stored(proven) });
                }
            }
        }
    }
    Ok(list)
}

/// Writes what the index lacks.
pub(crate) fn complete_index(connection: &Connection, to_index: &[ToIndex]) -> rusqlite::Result<()> {
    if to_index.is_empty() {
        return Ok(());
    }
    let transaction = connection.unchecked_transaction()?;
    to_index.iter().try_for_each(|(seq, sha256, summary)| index(&transaction, *seq, sha256, summary))?;
    transaction.commit()?;
    tracing::info!(model_sets = to_index.len(), "the index of model sets was made");
    Ok(())
}

/// Every row without its text, and how many have no index row.
fn entries(
    connection: &Connection,
    deletions: &Deletions,
    quarantined: &mut Vec<Quarantined>,
) -> rusqlite::Result<(Vec<Entry>, usize)> {
    let mut statement = connection.prepare(
        "SELECT seq, id, sha256, entry, checksum FROM model_sets LEFT JOIN set_index USING (seq) ORDER BY seq",
    )?;
    let mut rows = statement.query([])?;
    let (mut entries, mut without_index) = (Vec::new(), 0);
    let mut there = deletions.rows_of_sets();
    while let Some(row) = rows.next()? {
        let seq = row.get(0)?;
        there.insert(seq);
        let (id, sha256): (String, Vec<u8>) = match row.get(1).and_then(|id| Ok((id, row.get(2)?))) {
            Ok(known) => known,
            Err(error) => {
                quarantined.push(Quarantined::new(format!("model set in row {seq}"), error));
                continue;
            }
        };
        let indexed: Option<String> = row.get(3).unwrap_or_default();
        let summary = indexed.as_deref().and_then(|entry| believed(row, seq, &sha256, entry));
        let summary = summary.filter(|summary| summary.id == id);
        match (&indexed, &summary) {
            (None, _) => without_index += 1,
            (Some(_), None) => quarantined
                .push(Quarantined::new(format!("the index row of model set {id}"), "it was made again from the set")),
            _ => {}
        }
        entries.push(Entry { seq, id, sha256, summary });
    }
    let newest = there.last().copied().unwrap_or(0);
    let lost = newest.saturating_sub(there.len() as u64);
    if lost > 0 {
        quarantined.push(Quarantined::lost("the list of model sets", format!("{lost} of {newest} rows are missing")));
    }
    if let Some(reason) = shortfall(connection, Stream::ModelSets, newest)? {
        quarantined.push(Quarantined::lost("the list of model sets", reason));
    }
    Ok((entries, without_index))
}

fn believed(row: &Row<'_>, seq: u64, sha256: &[u8], entry: &str) -> Option<SetSummary> {
    let checksum: Vec<u8> = row.get(4).ok()?;
    (checksum == rows::index_checksum(seq, sha256, entry)).then(|| summary_from_text(entry)).flatten()
}

/// The summary of a set whose text is proven; without a `known` one from the text itself.
fn summary_of(
    connection: &Connection,
    seq: u64,
    id: &str,
    known: Option<&SetSummary>,
) -> rusqlite::Result<Result<SetSummary, String>> {
    Ok(match known {
        Some(known) => match text(connection, seq)? {
            Some(read) => read.map(|_| known.clone()),
            None => Err("its row is gone".to_owned()),
        },
        None => model_set(connection, seq, id)?.map(|set| SetSummary::of(&set)),
    })
}

/// The text in a row, or why it is not what was written; `None` if there is no such row.
pub(crate) fn text(connection: &Connection, seq: u64) -> rusqlite::Result<Option<Result<String, String>>> {
    let mut statement =
        connection.prepare_cached("SELECT sha256, json, length(json) FROM model_sets WHERE seq = ?1")?;
    statement.query_row([seq], |row| Ok(proven_text(row))).optional()
}

fn proven_text(row: &Row<'_>) -> Result<String, String> {
    let words = |error: rusqlite::Error| error.to_string();
    check_length(row.get(2).map_err(words)?)?;
    let (hash, json): (Vec<u8>, Vec<u8>) = (row.get(0).map_err(words)?, row.get(1).map_err(words)?);
    if hash != rows::sha256_of(&json) {
        return Err("its hash is not that of its content".to_owned());
    }
    String::from_utf8(json).map_err(|error| error.to_string())
}

/// The set in a row, or why it cannot be had.
pub(crate) fn model_set(connection: &Connection, seq: u64, id: &str) -> rusqlite::Result<Result<ModelSet, String>> {
    let Some(text) = text(connection, seq)? else { return Ok(Err("its row is gone".to_owned())) };
    Ok(text.and_then(|json| {
        let set = models_json::from_proven_json(&json).map_err(|error| error.to_string())?;
        if set.id == id { Ok(set) } else { Err(format!("its row names it `{id}`, its content is {}", set.id)) }
    }))
}
