//! Records become rows, in the order they happened: all of a batch or none.

use std::collections::BTreeMap;

use rusqlite::{Connection, Transaction, TransactionBehavior};
use taxel_engine::audit::Answered;
use taxel_engine::calibration::SessionView;
use taxel_engine::record::{Record, Sample};

use crate::audit;
use crate::db::State;
use crate::error::StoreError;
use crate::facts::{self, Key};
use crate::restore::{ACTIVE, Active, GENERATION, LOAD, NEXT_SESSION, SESSION, ZEROS};
use crate::samples::{self, Block};
use crate::sets;
use crate::watch::Watch;

/// A transaction on its way.
struct Change<'a> {
    transaction: &'a Transaction<'a>,
    state: &'a mut State,
    /// Samples that are not written yet.
    block: Option<Block>,
    /// Sessions that got samples.
    grown: BTreeMap<u64, u64>,
}

impl State {
    /// Writes all records or none, and returns once the disk has them: per session that grew, how many samples it has now.
    pub(crate) fn write<'r>(
        &mut self,
        connection: &Connection,
        mut records: impl Iterator<Item = &'r Record>,
    ) -> Result<BTreeMap<u64, u64>, StoreError> {
        if let Some(first) = &self.failure {
            return Err(StoreError::ReadOnly(first.to_string()));
        }
        // What is appended to a log that was cut off would hide that.
        self.check()?;
        let transaction = Transaction::new_unchecked(connection, TransactionBehavior::Immediate)?;
        let generation = self.generation + 1;
        let mut change = Change { transaction: &transaction, state: self, block: None, grown: BTreeMap::new() };
        records.try_for_each(|record| change.append(record))?;
        change.write_block()?;
        let grown = change.grown;
        facts::put(&transaction, GENERATION, &generation)?;
        if let Err(error) = transaction.commit() {
            // What was refused is in the log with all its pages, where the next start would find it.
            let Some(Err(why)) = self.watch.as_ref().map(Watch::cut_log) else { return Err(error.into()) };
            let left = "the next start may find what was refused, as it could not be cut off";
            return Err(StoreError::Disk(format!("{error}; {left}: {why}")));
        }
        self.generation = generation;
        // A commit into a file that nobody finds again is none.
        self.watch.as_mut().map_or(Ok(()), Watch::committed)?;
        Ok(grown)
    }
}

impl Change<'_> {
    fn append(&mut self, record: &Record) -> Result<(), StoreError> {
        if let Record::Sample { session, index, sample } = record {
            return self.sample(*session, *index, sample);
        }
        self.write_block()?;
        let connection = self.transaction;
        match record {
            Record::Session(view) => self.session(view),
            Record::Ramp { session, ramp } => samples::put_ramp(connection, *session, ramp),
            Record::ModelSet(set) => sets::put(connection, set),
            Record::Activated { patch, model_set, wall_ns } => self.activated(patch, model_set, *wall_ns),
            Record::ModelSetDeleted { model_set } => self.delete_set(model_set),
            Record::SessionDeleted { session } => self.delete_session(*session),
            Record::Load(load) => facts::put(connection, Key::numbered(LOAD, load.number), &**load),
            Record::Asked(asked) => {
                self.state.asked.insert(asked.request, audit::put_asked(connection, asked)?);
                Ok(())
            }
            Record::Answered(answered) => self.answered(answered),
            Record::Zero { patch, zero } => facts::put(connection, Key::named(ZEROS, patch), zero),
            Record::Sample { .. } => Ok(()),
        }
    }

    fn sample(&mut self, session: u64, index: u64, sample: &Sample) -> Result<(), StoreError> {
        let next = self.state.samples.entry(session).or_default();
        if index != *next {
            let what = format!("sample {index} of session {session}");
            return Err(StoreError::Unstorable { what, reason: format!("sample {next} is the next one") });
        }
        *next += 1;
        self.grown.insert(session, *next);
        if self.block.as_ref().is_some_and(|block| block.session != session) {
            self.write_block()?;
        }
        self.block.get_or_insert_with(|| Block::new(session, index)).add(sample);
        Ok(())
    }

    fn write_block(&mut self) -> Result<(), StoreError> {
        Ok(self.block.take().map_or(Ok(()), |block| block.write(self.transaction))?)
    }

    fn session(&mut self, view: &SessionView) -> Result<(), StoreError> {
        self.state.copy_due |= !view.state.is_open();
        let next: u64 = crate::restore::state(self.transaction, NEXT_SESSION)?;
        if view.number >= next {
            facts::put(self.transaction, NEXT_SESSION, &(view.number + 1))?;
        }
        facts::put(self.transaction, Key::numbered(SESSION, view.number), view)
    }

    fn activated(&mut self, patch: &str, model_set: &str, wall_ns: i64) -> Result<(), StoreError> {
        if !matches!(sets::text(self.transaction, model_set)?, Some(Ok(_))) {
            return Err(missing(format!("activation of model set `{model_set}` on patch `{patch}`")));
        }
        self.state.copy_due = true;
        let active = Active { model_set: model_set.to_owned(), wall_ns };
        facts::put(self.transaction, Key::named(ACTIVE, patch), &active)
    }

    fn delete_set(&mut self, id: &str) -> Result<(), StoreError> {
        (self.state.erasing, self.state.copy_due) = (true, true);
        for row in facts::all::<Active>(self.transaction, ACTIVE)? {
            if row.fact.is_ok_and(|active| active.model_set == id) {
                facts::delete(self.transaction, Key::named(ACTIVE, &row.name))?;
            }
        }
        let there = sets::delete(self.transaction, id)?;
        if there { Ok(()) } else { Err(missing(format!("the deletion of model set `{id}`"))) }
    }

    fn delete_session(&mut self, session: u64) -> Result<(), StoreError> {
        (self.state.erasing, self.state.copy_due) = (true, true);
        let there = facts::delete(self.transaction, Key::numbered(SESSION, session))?;
        samples::delete(self.transaction, session)?;
        self.state.samples.remove(&session);
        self.grown.remove(&session);
        if there { Ok(()) } else { Err(missing(format!("the deletion of session {session}"))) }
    }

    fn answered(&mut self, answered: &Answered) -> Result<(), StoreError> {
        match self.state.asked.remove(&answered.request) {
            Some(entry) => audit::put_answered(self.transaction, entry, answered),
            None => Err(missing(format!("the result of request {}", answered.request))),
        }
    }
}

fn missing(what: String) -> StoreError {
    StoreError::Unstorable { what, reason: "there is none in the store".to_owned() }
}
