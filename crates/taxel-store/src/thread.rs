//! The store's thread: it alone reads and writes the file. Acknowledgements go out from the thread itself.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use rusqlite::Connection;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::catalogue::StoreDamage;

use crate::copy::Part;
use crate::db::{Db, State};
use crate::error::{Quarantined, StoreError, lines};
use crate::lock::StoreLock;
use crate::retention::Size;
use crate::work::{Durability, Group, Work, WorkSource};
use crate::{audit, samples, sets};

/// What the store tells without being asked, on its thread.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StoreEvent {
    /// Samples of this session are on disk up to, not including, this index.
    Durable {
        /// Number of the session.
        session: u64,
        /// Samples on disk.
        samples: u64,
    },
    /// A write failed; why. Nothing is written any more.
    Failed(String),
    /// Something on disk was found damaged when it was asked for, or the copy could not be made.
    Damaged(StoreDamage),
}

/// Who hears the [`StoreEvent`]s. It runs between commits and must not wait.
pub type Notify = Box<dyn Fn(StoreEvent) + Send>;

/// A question, with what is done with the answer.
pub(crate) type Ask = Box<dyn FnOnce(Result<Turn<'_>, StoreError>) + Send>;

/// The thread's state.
pub(crate) struct Writer {
    connection: Connection,
    desk: Desk,
    lock: Option<StoreLock>,
}

/// All of it but the connection, which a copy that is being made holds.
pub(crate) struct Desk {
    state: State,
    notify: Notify,
    group: Group,
    /// All that was found damaged.
    found: Vec<Quarantined>,
}

/// Whoever asks has this for as long as it reads.
pub(crate) struct Turn<'a> {
    connection: &'a Connection,
    desk: &'a mut Desk,
}

impl Writer {
    pub(crate) fn new(Db { connection, state, lock }: Db, found: Vec<Quarantined>, notify: Notify) -> Self {
        Self { connection, desk: Desk { state, notify, group: Group::default(), found }, lock }
    }

    pub(crate) fn run(mut self, work: &WorkSource<Ask>) -> Result<(), StoreError> {
        if let Some(first) = &self.desk.state.failure {
            (self.desk.notify)(StoreEvent::Failed(first.to_string()));
        }
        // A fault of this programme ends all writing, as a failing disk does, and nobody waits for ever.
        while catch_unwind(AssertUnwindSafe(|| self.serve(work))).is_err() {
            self.desk.fail(StoreError::Panicked);
        }
        let Self { connection, desk: Desk { state, .. }, lock } = self;
        Db { connection, state, lock }.close()
    }

    fn serve(&mut self, work: &WorkSource<Ask>) {
        loop {
            let goes_on = self.desk.turn(&self.connection, work, None);
            self.copy_if_due(work);
            if !goes_on {
                return;
            }
        }
    }

    /// Makes a copy if something was written that it has to have. That it cannot be made ends nothing, and is told.
    fn copy_if_due(&mut self, work: &WorkSource<Ask>) {
        let appender = &mut self.desk.state.appender;
        if !std::mem::take(&mut appender.copy_due) || self.desk.state.failure.is_some() {
            return;
        }
        if let Err(error) = self.copy(work) {
            self.desk
                .tell(Quarantined::lost("the copy of the store", format!("it could not be made: {error}")), |_| ());
        }
    }

    /// Copies the database, a part at a time: commits and whoever asks have their turns in between.
    fn copy(&mut self, work: &WorkSource<Ask>) -> Result<(), StoreError> {
        let Some(path) = self.desk.state.path.clone() else { return Ok(()) };
        let mut part = Part::make(&path)?;
        let copying = part.begin(&self.connection)?;
        while !copying.step()? {
            while work.is_waiting() && self.desk.turn(&self.connection, work, Some(Duration::ZERO)) {}
            self.desk.flush(&self.connection);
            if let Some(failure) = &self.desk.state.failure {
                return Err(failure.clone());
            }
        }
        drop(copying);
        part.finish()
    }
}

impl Desk {
    /// Serves what comes next; false once nothing will come any more.
    fn turn(&mut self, connection: &Connection, work: &WorkSource<Ask>, most: Option<Duration>) -> bool {
        let next = match self.group.wait() {
            _ if self.group.is_full() => Err(RecvTimeoutError::Timeout),
            Some(wait) => work.next(Some(most.map_or(wait, |most| most.min(wait)))),
            None => work.next(most),
        };
        match next {
            Ok(Work::Write(entry)) => self.group.push(entry),
            Ok(Work::Ask(ask)) => {
                self.flush(connection);
                ask(Ok(Turn { connection, desk: self }));
            }
            Err(RecvTimeoutError::Timeout) => self.flush(connection),
            Err(RecvTimeoutError::Disconnected) => {
                self.flush(connection);
                return false;
            }
        }
        true
    }

    /// Commits the group, then tells everyone.
    fn flush(&mut self, connection: &Connection) {
        let group = std::mem::take(&mut self.group).entries;
        if group.is_empty() {
            return;
        }
        let kept = if self.state.path.is_some() { Durability::OnDisk } else { Durability::InMemory };
        let written = self.state.write(connection, group.iter().flat_map(|entry| &entry.records));
        // Whoever deleted something may rely on its bytes being gone. That the commit holds does not hang on it.
        let erased = if written.is_ok() { self.state.tidy_log(connection) } else { Ok(()) };
        let outcome = written.as_ref().map(|_| kept).map_err(Clone::clone);
        for entry in group {
            entry.waiting.tell(outcome.clone());
        }
        match written.and_then(|grown| erased.map(|()| grown)) {
            Ok(grown) => {
                grown.into_iter().for_each(|(session, samples)| {
                    (self.notify)(StoreEvent::Durable { session, samples });
                });
            }
            Err(error) => self.fail(error),
        }
    }

    /// Ends all writing; only the first failure counts.
    fn fail(&mut self, error: StoreError) {
        if self.state.failure.is_some() {
            return;
        }
        let error =
            error.with_corrupt("; the force goes on, and a restart looks at the file and takes the copy if it has to");
        tracing::error!("{error}; nothing is stored any more until the programme is started again");
        (self.notify)(StoreEvent::Failed(error.to_string()));
        self.state.failure = Some(error);
    }

    /// Tells of damage that was not told before.
    fn tell(&mut self, damage: Quarantined, what: impl FnOnce(&mut StoreDamage)) {
        if self.found.contains(&damage) {
            return;
        }
        tracing::error!("{damage}");
        self.found.push(damage);
        let mut told = StoreDamage { problems: lines(&self.found), ..StoreDamage::default() };
        what(&mut told);
        (self.notify)(StoreEvent::Damaged(told));
    }
}

impl Turn<'_> {
    pub(crate) fn samples(self, session: u64) -> Result<SessionSamples, StoreError> {
        samples::read(self.connection, session).map_err(|findings| {
            let damage = Quarantined::new(samples_of(session), &findings);
            self.desk.tell(damage, |told| told.sessions.push((session, findings.clone())));
            StoreError::DamagedSamples { session, findings }
        })
    }

    pub(crate) fn model_set(self, id: String) -> Result<String, StoreError> {
        let Some(text) = sets::text(self.connection, &id)? else {
            return Err(StoreError::NoModelSet { model_set: id });
        };
        text.map_err(|findings| {
            let damage = Quarantined::new(sets::name_of(&id), &findings);
            self.desk.tell(damage, |told| told.model_sets.push(id.clone()));
            StoreError::DamagedModelSet { model_set: id, findings }
        })
    }

    pub(crate) fn audit(self, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        Ok(audit::read(self.connection, before, most)?)
    }

    pub(crate) fn size(self) -> Result<Size, StoreError> {
        Ok(self.desk.state.size(self.connection)?)
    }
}

/// How findings name the samples of a session.
pub(crate) fn samples_of(session: u64) -> String {
    format!("samples of session {session}")
}
