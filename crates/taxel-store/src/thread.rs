//! The store's thread: it alone reads and writes the file. Acknowledgements go out from the thread itself.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use rusqlite::Connection;
use rusqlite::backup::{Backup, StepResult};
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;

use crate::db::{Db, State};
use crate::error::{Quarantined, StoreError};
use crate::work::{Durability, Entry, Group};
use crate::{audit, copy, samples, schema, sets};

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
    /// Something on disk was found damaged when it was asked for, or the copy could not be made: all of it so far, a line each.
    Damaged(Vec<String>),
}

/// Who hears the [`StoreEvent`]s. It runs between commits and must not wait.
pub type Notify = Box<dyn Fn(StoreEvent) + Send>;

/// Reads something, and tells it.
type Ask = Box<dyn FnOnce(&Connection, &mut Writer) + Send>;

/// What the thread is asked for, in one order.
pub(crate) enum Work {
    Write(Entry),
    Ask(Ask),
}

/// The thread's end of its queue.
pub(crate) struct WorkSource {
    pub(crate) work: Receiver<Work>,
    /// How much waits.
    pub(crate) waiting: Arc<AtomicUsize>,
}

impl WorkSource {
    /// The next work, which is waited for: so long at most, or for ever.
    fn next(&self, most: Option<Duration>) -> Result<Work, RecvTimeoutError> {
        let next = match most {
            Some(most) => self.work.recv_timeout(most),
            None => self.work.recv().map_err(RecvTimeoutError::from),
        };
        next.inspect(|_| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        })
    }
}

/// The thread's state; the connection is beside it, as a copy that is being made holds that.
pub(crate) struct Writer {
    state: State,
    notify: Notify,
    group: Group,
    /// All that was found damaged.
    found: Vec<Quarantined>,
}

/// Serves all work, until nobody is left who could ask. Gives how closing the file went.
pub(crate) fn run(
    Db { connection, state, lock }: Db,
    found: Vec<Quarantined>,
    notify: Notify,
    work: &WorkSource,
) -> Result<(), StoreError> {
    let mut writer = Writer { state, notify, group: Group::default(), found };
    if let Some(first) = &writer.state.failure {
        (writer.notify)(StoreEvent::Failed(first.to_string()));
    }
    // A fault of this programme ends all writing, as a failing disk does, and nobody waits for ever.
    while catch_unwind(AssertUnwindSafe(|| writer.serve(&connection, work))).is_err() {
        writer.fail(StoreError::Panicked);
    }
    Db { connection, state: writer.state, lock }.close()
}

impl Writer {
    fn serve(&mut self, connection: &Connection, work: &WorkSource) {
        loop {
            let turn = self.turn(connection, work, None);
            if std::mem::take(&mut self.state.copy_due)
                && self.state.failure.is_none()
                && let Err(error) = self.copy(connection, work)
            {
                // It ends nothing.
                let what = format!("it could not be made: {error}");
                self.tell(Quarantined::lost("the copy of the store", what));
            }
            if turn == Err(RecvTimeoutError::Disconnected) {
                return;
            }
        }
    }

    /// Copies the database, a part at a time: commits and queries have their turns in between.
    fn copy(&mut self, connection: &Connection, work: &WorkSource) -> Result<(), StoreError> {
        let Some(path) = self.state.path.clone() else { return Ok(()) };
        let mut part = copy::begin(&path)?;
        let backup = Backup::new(connection, &mut part)?;
        while !matches!(backup.step(copy::PAGES_AT_A_TIME)?, StepResult::Done) {
            while self.turn(connection, work, Some(Duration::ZERO)).is_ok() {}
            if let Some(failure) = &self.state.failure {
                return Err(failure.clone());
            }
        }
        drop(backup);
        copy::finish(part, &path)
    }

    /// Serves what comes next, within `most`.
    ///
    /// # Errors
    /// Nothing came, or nothing will come any more: all that came before is on the disk.
    fn turn(
        &mut self,
        connection: &Connection,
        work: &WorkSource,
        most: Option<Duration>,
    ) -> Result<(), RecvTimeoutError> {
        let next = match self.group.wait() {
            _ if self.group.is_full() => Err(RecvTimeoutError::Timeout),
            Some(wait) => work.next(Some(most.map_or(wait, |most| most.min(wait)))),
            None => work.next(most),
        };
        if !matches!(next, Ok(Work::Write(_))) {
            self.flush(connection);
        }
        match next? {
            Work::Write(entry) => self.group.push(entry),
            Work::Ask(ask) => ask(connection, self),
        }
        Ok(())
    }

    /// Commits the group, then tells everyone.
    fn flush(&mut self, connection: &Connection) {
        let group = std::mem::take(&mut self.group).entries;
        if group.is_empty() {
            return;
        }
        let kept = if self.state.path.is_some() { Durability::OnDisk } else { Durability::InMemory };
        let written = self.state.write(connection, group.iter().flat_map(|entry| &entry.records));
        // After a deletion the bytes have to be gone. That the commit holds does not hang on it.
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
        tracing::error!(
            "{error}; the force goes on, and nothing is stored any more until the programme is started again"
        );
        (self.notify)(StoreEvent::Failed(error.to_string()));
        self.state.failure = Some(error);
    }

    /// Tells of damage that was not told before.
    fn tell(&mut self, damage: Quarantined) {
        if self.found.contains(&damage) {
            return;
        }
        tracing::error!("{damage}");
        self.found.push(damage);
        (self.notify)(StoreEvent::Damaged(self.found.iter().map(ToString::to_string).collect()));
    }

    pub(crate) fn samples(&mut self, connection: &Connection, session: u64) -> Result<SessionSamples, StoreError> {
        samples::read(connection, session).map_err(|findings| {
            let damage = Quarantined::new(samples::name_of(session), findings);
            self.tell(damage.clone());
            StoreError::DamagedRow(damage)
        })
    }

    pub(crate) fn model_set(&mut self, connection: &Connection, id: String) -> Result<String, StoreError> {
        let Some(text) = sets::text(connection, &id)? else { return Err(StoreError::NoModelSet(id)) };
        text.map_err(|findings| {
            let damage = Quarantined::new(sets::name_of(&id), findings);
            self.tell(damage.clone());
            StoreError::DamagedRow(damage)
        })
    }

    pub(crate) fn audit(&self, connection: &Connection, before: u64, most: u32) -> Result<Vec<AuditEntry>, StoreError> {
        Ok(audit::read(connection, before, most)?)
    }

    /// Bytes of the database that are in use.
    pub(crate) fn size(&self, connection: &Connection) -> Result<u64, StoreError> {
        let [pages, free, bytes] = schema::pages(connection)?;
        Ok(pages.saturating_sub(free) * bytes)
    }
}
