//! Records become rows, in the order they happened.

use std::collections::{BTreeMap, HashMap, HashSet};

use rusqlite::{Connection, OptionalExtension, Transaction, params};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::{Record, Sample};
use taxel_engine::rest::TaxelBaseline;
use taxel_engine::session::SessionView;
use taxel_engine::snapshot::TareView;

use crate::error::StoreError;
use crate::models_json;
use crate::rows;

/// Appends records and refuses those that do not follow from what is there.
pub(crate) struct Appender {
    /// Ids of the sets that are intact on disk.
    model_sets: HashSet<String>,
    /// Per session, the index that its next sample must have.
    next_index: HashMap<u64, u64>,
    /// Sessions that got samples since the last commit.
    grown: BTreeMap<u64, u64>,
}

impl Appender {
    pub(crate) fn new(model_sets: impl IntoIterator<Item = String>) -> Self {
        Self { model_sets: model_sets.into_iter().collect(), next_index: HashMap::new(), grown: BTreeMap::new() }
    }

    /// Per session that grew since the last call, how many samples it has.
    pub(crate) fn take_grown(&mut self) -> Vec<(u64, u64)> {
        std::mem::take(&mut self.grown).into_iter().collect()
    }

    pub(crate) fn append(&mut self, transaction: &Transaction<'_>, record: &Record) -> Result<(), StoreError> {
        match record {
            Record::Session(view) => session(transaction, view),
            Record::Ramp { session, ramp, baseline } => append_ramp(transaction, *session, *ramp, baseline),
            Record::Sample { session, index, sample } => self.sample(transaction, *session, *index, sample),
            Record::ModelSet(set) => self.model_set(transaction, set),
            Record::Activated { patch, model_set, wall_ns } => self.activated(transaction, patch, model_set, *wall_ns),
            Record::Tared { patch, tare, baseline } => tared(transaction, patch, tare, baseline),
        }
    }

    fn sample(&mut self, connection: &Connection, session: u64, index: u64, sample: &Sample) -> Result<(), StoreError> {
        let unstorable = |reason: String| {
            Err(StoreError::Unstorable { what: format!("sample {index} of session {session}"), reason })
        };
        if !sample.pressure_kpa.is_finite() {
            return unstorable(format!("its pressure is {} kPa, expected a finite number", sample.pressure_kpa));
        }
        let expected = match self.next_index.get(&session) {
            Some(&next) => next,
            None => stored_samples(connection, session)?,
        };
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
                &sample.counts[..],
                rows::sample_checksum(session, index, sample),
            ])?;
        self.next_index.insert(session, index + 1);
        self.grown.insert(session, index + 1);
        Ok(())
    }

    fn model_set(&mut self, connection: &Connection, set: &ModelSet) -> Result<(), StoreError> {
        if self.model_sets.contains(&set.id) {
            return Ok(()); // the id is the content's hash: it is there already
        }
        let unstorable = |reason: String| StoreError::Unstorable { what: format!("model set {}", set.id), reason };
        let json = models_json::to_json(set).map_err(|error| unstorable(error.to_string()))?;
        // What goes to disk is proven readable first: a set that could not be loaded again is no use there.
        models_json::from_json(&json).map_err(|error| unstorable(error.to_string()))?;
        connection.execute(
            "INSERT INTO model_sets (id, sha256, json) VALUES (?1, ?2, ?3)",
            params![set.id, rows::sha256_of(json.as_bytes()), json.as_bytes()],
        )?;
        self.model_sets.insert(set.id.clone());
        Ok(())
    }

    fn activated(&self, connection: &Connection, patch: &str, set: &str, wall_ns: i64) -> Result<(), StoreError> {
        if !self.model_sets.contains(set) {
            let what = format!("activation of model set `{set}` on patch `{patch}`");
            return Err(StoreError::Unstorable { what, reason: "the store has no such set".to_owned() });
        }
        connection.execute(
            "INSERT INTO activations (patch, model_set, wall_ns, checksum) VALUES (?1, ?2, ?3, ?4)",
            params![patch, set, wall_ns, rows::activation_checksum(patch, set, wall_ns)],
        )?;
        Ok(())
    }
}

/// Samples of a session that are stored.
fn stored_samples(connection: &Connection, session: u64) -> Result<u64, StoreError> {
    let newest: Option<u64> = connection
        .query_row("SELECT idx FROM samples WHERE session = ?1 ORDER BY idx DESC LIMIT 1", [session], |row| row.get(0))
        .optional()?;
    Ok(newest.map_or(0, |index| index + 1))
}

fn session(connection: &Connection, view: &SessionView) -> Result<(), StoreError> {
    let text = rows::view_to_text(view).map_err(|error| StoreError::Unstorable {
        what: format!("session {}", view.number),
        reason: error.to_string(),
    })?;
    connection
        .prepare_cached(
            "INSERT INTO sessions (number, view, checksum) VALUES (?1, ?2, ?3)
             ON CONFLICT (number) DO UPDATE SET view = excluded.view, checksum = excluded.checksum",
        )?
        .execute(params![view.number, text, rows::view_checksum(view.number, &text)])?;
    Ok(())
}

fn append_ramp(connection: &Connection, session: u64, ramp: u16, baseline: &[TaxelBaseline]) -> Result<(), StoreError> {
    let blob = rows::baseline_to_blob(baseline);
    connection.execute(
        "INSERT INTO ramps (session, ramp, baseline, checksum) VALUES (?1, ?2, ?3, ?4)",
        params![session, ramp, blob, rows::ramp_checksum(session, ramp, &blob)],
    )?;
    Ok(())
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
