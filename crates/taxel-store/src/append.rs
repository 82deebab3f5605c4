//! Records become rows, in the order they happened.

use std::collections::{BTreeMap, HashMap};

use rusqlite::{Connection, ErrorCode, Transaction, params};
use taxel_engine::audit::{Answered, Asked};
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::SessionView;
use taxel_engine::known_set::SetSummary;
use taxel_engine::loads::Load;
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::{BoardZeros, RampBaseline, Record, Sample};
use taxel_engine::snapshot::TareView;

use crate::audit_rows;
use crate::board_zeros;
use crate::error::StoreError;
use crate::load_row::{load_from_text, load_to_text};
use crate::models_json;
use crate::rows;
use crate::sets;
use crate::tally::{Stream, Tally};

/// Appends records and refuses those that do not follow from what is there.
#[derive(Default)]
pub(crate) struct Appender {
    /// Rows of the sets that are on disk, by their ids; none that is known to be damaged.
    model_sets: HashMap<String, u64>,
    /// How many rows there are of each sort, and so which number comes next.
    tally: Tally,
    /// Sessions that got samples since the last commit.
    grown: BTreeMap<u64, u64>,
    /// Requests of this run that have no result yet: their rows, by their numbers in the run.
    asked: HashMap<u64, u64>,
}

impl Appender {
    pub(crate) fn new(model_sets: impl IntoIterator<Item = (String, u64)>) -> Self {
        Self { model_sets: model_sets.into_iter().collect(), tally: Tally::default(), ..Self::default() }
    }

    /// The row of a model set.
    pub(crate) fn row_of_set(&self, id: &str) -> Option<u64> {
        self.model_sets.get(id).copied()
    }

    /// A model set was found damaged: it is as good as not there, and can be written again.
    pub(crate) fn lose_set(&mut self, id: &str) {
        self.model_sets.remove(id);
    }

    /// Before a transaction: if the record is a model set that is there and is found damaged now, it is written again. Within
    /// the transaction SQLite writes nothing more once it has met a damaged page.
    pub(crate) fn look_at_set(&mut self, connection: &Connection, record: &Record) -> Result<(), StoreError> {
        if let Record::ModelSet(set) = record
            && let Some(seq) = self.row_of_set(&set.id)
            && !is_sound(connection, seq)?
        {
            self.lose_set(&set.id);
        }
        Ok(())
    }

    /// Ends a transaction: per session that grew in it, how many samples it has.
    pub(crate) fn finish(&mut self, transaction: &Transaction<'_>) -> Result<Vec<(u64, u64)>, StoreError> {
        self.tally.save(transaction)?;
        Ok(std::mem::take(&mut self.grown).into_iter().collect())
    }

    pub(crate) fn append(&mut self, transaction: &Transaction<'_>, record: &Record) -> Result<(), StoreError> {
        match record {
            Record::Session(view) => self.session(transaction, view),
            Record::Ramp { session, ramp } => self.ramp(transaction, *session, ramp),
            Record::Sample { session, index, sample } => self.sample(transaction, *session, *index, sample),
            Record::ModelSet(set) => self.model_set(transaction, set),
            Record::Activated { patch, model_set, wall_ns } => self.activated(transaction, patch, model_set, *wall_ns),
            Record::ModelSetDeleted { model_set, wall_ns } => self.delete_model_set(transaction, model_set, *wall_ns),
            Record::SessionDeleted { session, wall_ns } => self.delete_session(transaction, *session, *wall_ns),
            Record::Load(load) => self.load(transaction, load),
            Record::Asked(asked) => self.asked(transaction, asked),
            Record::Answered(answered) => self.answered(transaction, answered),
            Record::BoardZeros { patch, zeros, wall_ns } => self.board_zeros(transaction, patch, zeros, *wall_ns),
            Record::Tared { patch, tare, baseline } => tared(transaction, patch, tare, baseline),
        }
    }

    fn session(&mut self, connection: &Connection, view: &SessionView) -> Result<(), StoreError> {
        let text = rows::view_to_text(view).map_err(|error| StoreError::Unstorable {
            what: format!("session {}", view.number),
            reason: error.to_string(),
        })?;
        let row = params![view.number, text, rows::view_checksum(view.number, &text)];
        let changed = connection
            .prepare_cached("UPDATE sessions SET view = ?2, checksum = ?3 WHERE number = ?1")?
            .execute(row)?;
        if changed == 0 {
            connection.execute("INSERT INTO sessions (number, view, checksum) VALUES (?1, ?2, ?3)", row)?;
            let sessions = self.tally.get(connection, Stream::Sessions)? + 1;
            self.tally.set(Stream::Sessions, sessions);
        }
        Ok(())
    }

    fn ramp(&mut self, connection: &Connection, session: u64, begun: &RampBaseline) -> Result<(), StoreError> {
        let expected = self.tally.get(connection, Stream::Ramps(session))?;
        let ramp = begun.ramp;
        if u64::from(ramp) != expected {
            let what = format!("ramp {ramp} of session {session}");
            return Err(StoreError::Unstorable { what, reason: format!("ramp {expected} is the next one") });
        }
        let blob = rows::ramp_to_blob(begun);
        connection.execute(
            "INSERT INTO ramps (session, ramp, baseline, checksum) VALUES (?1, ?2, ?3, ?4)",
            params![session, ramp, blob, rows::ramp_checksum(session, ramp, &blob)],
        )?;
        self.tally.set(Stream::Ramps(session), expected + 1);
        Ok(())
    }

    fn sample(&mut self, connection: &Connection, session: u64, index: u64, sample: &Sample) -> Result<(), StoreError> {
        let unstorable = |reason: String| {
            Err(StoreError::Unstorable { what: format!("sample {index} of session {session}"), reason })
        };
        if !sample.pressure_kpa.is_finite() {
            return unstorable(format!("its pressure is {} kPa, expected a finite number", sample.pressure_kpa));
        }
        let expected = self.tally.get(connection, Stream::Samples(session))?;
        if index != expected {
            return unstorable(format!("sample {expected} is the next one"));
        }
        connection
            .prepare_cached(
                "INSERT INTO samples (session, idx, ramp, time_ns, pressure_kpa, counts, checksum)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
            )?
            .execute(params![
                session,
                index,
                sample.ramp,
                sample.time_ns,
                sample.pressure_kpa,
                rows::counts_to_blob(sample.counts.counts()),
                rows::sample_checksum(session, index, sample),
            ])?;
        self.tally.set(Stream::Samples(session), index + 1);
        self.grown.insert(session, index + 1);
        Ok(())
    }

    fn model_set(&mut self, connection: &Connection, set: &ModelSet) -> Result<(), StoreError> {
        // The id is the content's hash: it is there already.
        if self.model_sets.contains_key(&set.id) {
            return Ok(());
        }
        let unstorable = |reason: String| StoreError::Unstorable { what: format!("model set {}", set.id), reason };
        let json = models_json::to_json(set).map_err(|error| unstorable(error.to_string()))?;
        // What goes to disk is proven readable first: a set that could not be loaded again is no use there.
        models_json::from_json(&json).map_err(|error| unstorable(error.to_string()))?;
        let tally = self.tally.get(connection, Stream::ModelSets)?;
        let seq =
            next_seq(connection, tally, "(SELECT seq FROM model_sets UNION ALL SELECT seq FROM deleted_model_sets)")?;
        let hash = rows::sha256_of(json.as_bytes());
        connection.execute(
            "INSERT INTO model_sets (seq, id, sha256, json) VALUES (?1, ?2, ?3, ?4)",
            params![seq, set.id, hash, json.as_bytes()],
        )?;
        sets::index(connection, seq, &hash, &SetSummary::of(set))?;
        self.tally.set(Stream::ModelSets, seq);
        self.model_sets.insert(set.id.clone(), seq);
        Ok(())
    }

    /// Every row with this id goes, also one that is damaged; for each a row stays that says so.
    fn delete_model_set(&mut self, connection: &Connection, id: &str, wall_ns: i64) -> Result<(), StoreError> {
        let mut statement = connection.prepare("SELECT seq FROM model_sets WHERE id = ?1 ORDER BY seq")?;
        let rows = statement.query_map([id], |row| row.get(0))?.collect::<Result<Vec<u64>, _>>()?;
        if rows.is_empty() {
            let what = format!("the deletion of model set `{id}`");
            return Err(StoreError::Unstorable { what, reason: "the store has no such set".to_owned() });
        }
        let activation = self.tally.get(connection, Stream::Activations)?;
        for seq in rows {
            connection.execute(
                "INSERT INTO deleted_model_sets (seq, id, activation, wall_ns, checksum) VALUES (?1, ?2, ?3, ?4, ?5)",
                params![seq, id, activation, wall_ns, rows::deleted_set_checksum(seq, id, activation, wall_ns)],
            )?;
            connection.execute("DELETE FROM model_sets WHERE seq = ?1", [seq])?;
            connection.execute("DELETE FROM set_index WHERE seq = ?1", [seq])?;
            let deleted = self.tally.get(connection, Stream::DeletedModelSets)? + 1;
            self.tally.set(Stream::DeletedModelSets, deleted);
        }
        self.model_sets.remove(id);
        Ok(())
    }

    /// The session goes with its ramps and samples; a row stays that says so, and so its number is never used again.
    fn delete_session(&mut self, connection: &Connection, session: u64, wall_ns: i64) -> Result<(), StoreError> {
        let there: bool =
            connection
                .query_row("SELECT EXISTS (SELECT 1 FROM sessions WHERE number = ?1)", [session], |r| r.get(0))?;
        if !there {
            let what = format!("the deletion of session {session}");
            return Err(StoreError::Unstorable { what, reason: "the store has no such session".to_owned() });
        }
        connection.execute(
            "INSERT INTO deleted_sessions (number, wall_ns, checksum) VALUES (?1, ?2, ?3)",
            params![session, wall_ns, rows::deleted_session_checksum(session, wall_ns)],
        )?;
        for statement in [
            "DELETE FROM samples WHERE session = ?1",
            "DELETE FROM ramps WHERE session = ?1",
            "DELETE FROM sessions WHERE number = ?1",
        ] {
            connection.execute(statement, [session])?;
        }
        for stream in [Stream::Ramps(session), Stream::Samples(session)] {
            self.tally.forget(connection, stream)?;
        }
        self.grown.remove(&session);
        let deleted = self.tally.get(connection, Stream::DeletedSessions)? + 1;
        self.tally.set(Stream::DeletedSessions, deleted);
        Ok(())
    }

    fn load(&mut self, connection: &Connection, load: &Load) -> Result<(), StoreError> {
        let unstorable = |error: serde_json::Error| StoreError::Unstorable {
            what: format!("load {}", load.number),
            reason: error.to_string(),
        };
        let text = load_to_text(load).map_err(unstorable)?;
        load_from_text(&text).map_err(unstorable)?; // a figure that is no number could not be read again
        connection.execute(
            "INSERT INTO loads (number, load, checksum) VALUES (?1, ?2, ?3)",
            params![load.number, text, rows::load_checksum(load.number, &text)],
        )?;
        let loads = self.tally.get(connection, Stream::Loads)? + 1;
        self.tally.set(Stream::Loads, loads);
        Ok(())
    }

    fn asked(&mut self, connection: &Connection, asked: &Asked) -> Result<(), StoreError> {
        let seq = next_seq(connection, self.tally.get(connection, Stream::Audit)?, "audit")?;
        audit_rows::insert_asked(connection, seq, asked)?;
        self.tally.set(Stream::Audit, seq);
        self.asked.insert(asked.request, seq);
        Ok(())
    }

    fn answered(&mut self, connection: &Connection, answered: &Answered) -> Result<(), StoreError> {
        let Some(seq) = self.asked.remove(&answered.request) else {
            let what = format!("the result of request {}", answered.request);
            return Err(StoreError::Unstorable { what, reason: "nobody asked, or it has one already".to_owned() });
        };
        audit_rows::insert_answered(connection, seq, answered)?;
        let results = self.tally.get(connection, Stream::AuditResults)? + 1;
        self.tally.set(Stream::AuditResults, results);
        Ok(())
    }

    fn board_zeros(
        &mut self,
        connection: &Connection,
        patch: &str,
        zeros: &BoardZeros,
        wall_ns: i64,
    ) -> Result<(), StoreError> {
        let seq = next_seq(connection, self.tally.get(connection, Stream::BoardZeros)?, "zero_doubts")?;
        board_zeros::insert(connection, seq, patch, zeros, wall_ns)?;
        self.tally.set(Stream::BoardZeros, seq);
        Ok(())
    }

    fn activated(&mut self, connection: &Connection, patch: &str, set: &str, wall_ns: i64) -> Result<(), StoreError> {
        if !self.model_sets.contains_key(set) {
            let what = format!("activation of model set `{set}` on patch `{patch}`");
            return Err(StoreError::Unstorable { what, reason: "the store has no such set".to_owned() });
        }
        let seq = next_seq(connection, self.tally.get(connection, Stream::Activations)?, "activations")?;
        connection.execute(
            "INSERT INTO activations (seq, patch, model_set, wall_ns, checksum) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![seq, patch, set, wall_ns, rows::activation_checksum(seq, patch, set, wall_ns)],
        )?;
        self.tally.set(Stream::Activations, seq);
        Ok(())
    }
}

/// Whether a model set can be read. One on a page that is damaged cannot, as one whose content is.
fn is_sound(connection: &Connection, seq: u64) -> rusqlite::Result<bool> {
    match sets::text(connection, seq) {
        Err(error) if error.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt) => Ok(false),
        read => Ok(matches!(read?, Some(Ok(_)))),
    }
}

/// The number of the next row: also if the tally was damaged, one that no row has.
fn next_seq(connection: &Connection, tally: u64, table: &str) -> rusqlite::Result<u64> {
    let newest: u64 =
        connection.query_row(&format!("SELECT coalesce(max(seq), 0) FROM {table}"), [], |row| row.get(0))?;
    Ok(newest.max(tally) + 1)
}

fn tared(connection: &Connection, patch: &str, tare: &TareView, baseline: &[TaxelBaseline]) -> Result<(), StoreError> {
    connection.execute(
        "INSERT INTO tares (patch, epoch, valid, wall_ns, reason, baseline_median, noise_median, baseline)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
        params![
            patch,
            tare.epoch,
            tare.valid,
            tare.wall_ns,
            tare.reason,
            tare.baseline_median,
            tare.noise_median,
            rows::baseline_to_blob(baseline),
        ],
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only what the file is to blame for says that the set is not sound.
    #[test]
    fn a_set_that_cannot_be_asked_for_is_neither_sound_nor_unsound() {
        let nothing = Connection::open_in_memory().unwrap();
        assert!(is_sound(&nothing, 1).unwrap_err().to_string().contains("no such table"));
    }
}
