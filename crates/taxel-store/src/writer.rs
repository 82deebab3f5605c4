//! One thread owns the file. Batches come in through a bounded queue, acknowledgements go out from the thread itself.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, TrySendError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::catalogue::StoreDamage;

use crate::db::Db;
use crate::error::{Quarantined, StoreError, lines};
use crate::group::Group;
use crate::pass::{Finding, Lost, Step};
use crate::readers::{AuditReader, SamplesReader, SetReader, SizeReader, read_samples, read_set};
use crate::retention::Retention;
use crate::work::{
    Batch, Durability, Entry, OnModelSet, OnSamples, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, QueueFull, Waiting, Work,
    WorkQueue, WorkSource, work_queue,
};

/// What a start has left is proven from here on, a part at a time: a large model set takes the thread some milliseconds.
const PROVE_AFTER: Duration = Duration::from_secs(1);
const PROVE_EVERY: Duration = Duration::from_millis(10);

/// The look at the file's structure takes seconds for a gigabyte and begins anew if work comes in between: first after so
/// long, then after twice as long each time.
const STRUCTURE_AGAIN: Duration = Duration::from_secs(10);
const STRUCTURE_AGAIN_MAX: Duration = Duration::from_secs(3600);

/// What an operator has to know of a damaged file.
const MENDED_BY_A_RESTART: &str = "the force goes on, and a restart looks at all of the file and mends it";

/// What the store tells without being asked, on the writer's thread.
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
    /// Something on disk was found damaged: when it was asked for, or while the store was proven.
    Damaged(StoreDamage),
}

/// Who hears the [`StoreEvent`]s. It runs between commits and must not wait.
pub type Notify = Box<dyn Fn(StoreEvent) + Send>;

/// The handle to the writer. All methods return at once, but [`Store::open`] and [`Store::close`].
#[derive(Debug)]
pub struct Store {
    /// The writer's thread holds the receiver; dropping this ends it after a last flush.
    queue: Arc<WorkQueue>,
    /// Its result is that of the last flush.
    thread: JoinHandle<Result<(), StoreError>>,
}

impl Store {
    /// Opens or creates the store at `path` and starts its writer. A small store is proven whole; of a large one the rest is
    /// proven while it is open, and what is found then is told as [`StoreEvent::Damaged`].
    ///
    /// Gives what the engine starts from, and what was found damaged and left out of it: all of that, where the lines in
    /// [`Restored::problems`] are bounded.
    ///
    /// Where the disk takes nothing, or a damaged file cannot be put right, what can be read is handed out all the same, at
    /// least the active model sets: [`StoreEvent::Failed`] comes at once, and every batch is refused with the reason.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be read, is another process's, another programme's or a newer version's; or if its
    /// structure is broken, it cannot be put right, and no plain file has active model sets.
    pub fn open(path: &Path, notify: Notify) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        Self::open_keeping(path, &Retention::default(), notify)
    }

    /// As [`Store::open`], and deletes what is beyond `limits`, oldest first, but nothing that is in use.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_keeping(
        path: &Path,
        limits: &Retention,
        notify: Notify,
    ) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        let (db, restored, quarantined) = Db::open_keeping(path, limits)?;
        Ok((Self::start(db, quarantined.clone(), notify)?, restored, quarantined))
    }

    /// A store that ends with the process, for the demo and for tests.
    ///
    /// # Errors
    /// [`StoreError::Io`] if memory or a thread is not to be had.
    pub fn in_memory(notify: Notify) -> Result<Self, StoreError> {
        Self::start(Db::in_memory()?, Vec::new(), notify)
    }

    /// As [`Store::open`], but the file may grow by no more than so many pages of 4 KiB: for tests that meet a full disk.
    ///
    /// # Errors
    /// As [`Store::open`].
    #[cfg(any(test, feature = "fixtures"))]
    pub fn open_with_room(path: &Path, pages: u32, notify: Notify) -> Result<(Self, Restored), StoreError> {
        let (db, restored, _) = Db::open(path)?;
        db.limit_growth(pages.into())?;
        Ok((Self::start(db, Vec::new(), notify)?, restored))
    }

    pub(crate) fn start(db: Db, found: Vec<Quarantined>, notify: Notify) -> Result<Self, StoreError> {
        let (queue, work) = work_queue();
        let writer = Writer::new(db, found, notify);
        let thread = std::thread::Builder::new()
            .name("store".to_owned())
            .spawn(move || writer.run(&work))
            .map_err(|error| StoreError::Io(format!("cannot start its thread: {error}")))?;
        Ok(Self { queue: Arc::new(queue), thread })
    }

    /// Hands a batch to the writer. Never waits.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit(&self, batch: Batch) -> Result<(), QueueFull> {
        let Batch { records, on_durable } = batch;
        match self.queue.try_send(Work::Write(Entry { records, waiting: Waiting(on_durable) })) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(work)) => Err(QueueFull { batch: work.into_batch(), most: QUEUE_BATCHES }),
            Err(TrySendError::Disconnected(_)) => Ok(()), // whoever waits was told as this was dropped
        }
    }

    /// As [`Store::submit`], for what somebody asks for: it is refused while more than [`QUEUE_BATCHES_ASKED`] wait, so that
    /// whoever asks much of a slow disk takes no room from what must be stored.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit_asked(&self, batch: Batch) -> Result<(), QueueFull> {
        if self.queue.waiting() >= QUEUE_BATCHES_ASKED {
            return Err(QueueFull { batch, most: QUEUE_BATCHES_ASKED });
        }
        self.submit(batch)
    }

    /// Reads the samples of a session, after all that was submitted before. Never waits.
    pub fn read_samples(&self, session: u64, on_samples: OnSamples) {
        read_samples(&self.queue, session, on_samples);
    }

    /// Reads the text of a model set, after all that was submitted before. Never waits.
    pub fn read_model_set(&self, model_set: String, on_model_set: OnModelSet) {
        read_set(&self.queue, model_set, on_model_set);
    }

    /// Reads model sets for whoever does not own the store; it does not keep the store open.
    #[must_use]
    pub fn set_reader(&self) -> SetReader {
        SetReader(Arc::downgrade(&self.queue))
    }

    /// Reads samples for whoever does not own the store; it does not keep the store open.
    #[must_use]
    pub fn reader(&self) -> SamplesReader {
        SamplesReader(Arc::downgrade(&self.queue))
    }

    /// What reads the audit log; it may outlive the store.
    #[must_use]
    pub fn audit_reader(&self) -> AuditReader {
        AuditReader(Arc::downgrade(&self.queue))
    }

    /// What tells how much the store holds; it may outlive the store.
    #[must_use]
    pub fn size_reader(&self) -> SizeReader {
        SizeReader(Arc::downgrade(&self.queue))
    }

    /// Writes what waits, folds the log back into the file and closes it.
    ///
    /// # Errors
    /// The first failure of this store, if there was one: what came after it is not on disk.
    pub fn close(self) -> Result<(), StoreError> {
        drop(self.queue);
        self.thread.join().unwrap_or(Err(StoreError::Closed))
    }
}

/// The thread's state.
pub(crate) struct Writer {
    /// The file, or the first failure, after which nothing is tried again: once a flush has failed, the kernel may
    /// have dropped what it could not write, and a second flush would succeed without it.
    db: Result<Db, StoreError>,
    notify: Notify,
    group: Group,
    /// All that was found damaged.
    found: Vec<Quarantined>,
    /// When the next part of what is not proven is; `None` if all is.
    prove_at: Option<Instant>,
    /// How long to wait before a proof that was disturbed begins anew.
    undisturbed: Duration,
}

impl Writer {
    pub(crate) fn new(db: Db, found: Vec<Quarantined>, notify: Notify) -> Self {
        let prove_at = (!db.is_proven()).then(|| Instant::now() + PROVE_AFTER);
        let db = db.writable();
        let prove_at = prove_at.filter(|_| db.is_ok());
        Self { db, notify, group: Group::default(), found, prove_at, undisturbed: STRUCTURE_AGAIN }
    }

    fn run(mut self, work: &WorkSource) -> Result<(), StoreError> {
        if let Err(first) = &self.db {
            (self.notify)(StoreEvent::Failed(first.to_string()));
        }
        // A fault of this programme ends all writing, as a failing disk does, and nobody waits for ever.
        while catch_unwind(AssertUnwindSafe(|| self.serve(work))).is_err() {
            self.fail(StoreError::Panicked);
        }
        self.db.and_then(Db::close)
    }

    fn serve(&mut self, work: &WorkSource) {
        loop {
            match self.next(work) {
                Ok(Work::Write(entry)) => self.group.push(entry),
                Ok(Work::Read { session, waiting }) => {
                    self.flush();
                    waiting.tell(self.read(session));
                }
                Ok(Work::ReadSet { model_set, waiting }) => {
                    self.flush();
                    waiting.tell(self.read_set(&model_set));
                }
                Ok(Work::Audit { before, most, waiting }) => {
                    self.flush();
                    waiting.tell(self.db().and_then(|db| db.audit(before, most)));
                }
                Ok(Work::Size { waiting }) => {
                    self.flush();
                    waiting.tell(self.db().and_then(|db| db.size()));
                }
                Err(RecvTimeoutError::Timeout) => {
                    self.flush();
                    self.prove_if_due(work);
                }
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.flush();
    }

    /// The next work; none comes in time for a group that is full, or whose wait is over, and when a part is to be proven.
    fn next(&self, work: &WorkSource) -> Result<Work, RecvTimeoutError> {
        if self.group.is_full() {
            return Err(RecvTimeoutError::Timeout);
        }
        work.next(self.group.wait().or_else(|| self.until_proof()))
    }

    /// How long it is until the next part is to be proven; `None` if none is.
    pub(crate) fn until_proof(&self) -> Option<Duration> {
        self.prove_at.map(|at| at.saturating_duration_since(Instant::now()))
    }

    /// The file, unless something failed before.
    fn db(&mut self) -> Result<&mut Db, StoreError> {
        self.db.as_mut().map_err(|first| StoreError::ReadOnly { reason: first.to_string() })
    }

    fn read(&mut self, session: u64) -> Result<SessionSamples, StoreError> {
        let read = self.db()?.samples(session);
        read.map_err(|findings| {
            self.tell_damage(&Finding::of_samples(session, &findings));
            StoreError::DamagedSamples { session, findings }
        })
    }

    fn read_set(&mut self, model_set: &str) -> Result<String, StoreError> {
        let read = self.db()?.set_text(model_set);
        if let Err(StoreError::DamagedModelSet { findings, .. }) = &read {
            self.tell_damage(&Finding::of_set(model_set, findings));
        }
        read
    }

    /// Proves the next part of what a start has left, if that is due.
    fn prove_if_due(&mut self, work: &WorkSource) {
        let now = Instant::now();
        let (Ok(db), true) = (&mut self.db, self.prove_at.is_some_and(|at| at <= now)) else { return };
        let mut pause = PROVE_EVERY;
        let step = db.prove_next(work.look());
        let over = db.is_proven();
        match step {
            Step::Sound => {}
            Step::Found(finding) => {
                self.tell_damage(&finding);
                // What is written into such a file may be lost with it, so that nothing more is called stored.
                if finding.lost == Lost::Structure {
                    self.fail(StoreError::Corrupt(finding.damage.reason));
                    return;
                }
            }
            Step::Disturbed => {
                pause = self.undisturbed;
                self.undisturbed = (2 * pause).min(STRUCTURE_AGAIN_MAX);
            }
        }
        if over {
            tracing::info!(damaged = self.found.len(), "all of the store was looked at");
        }
        self.prove_at = (!over).then(|| Instant::now() + pause);
    }

    /// Tells damage that was not told before, and remembers it.
    fn tell_damage(&mut self, finding: &Finding) {
        if let Ok(db) = &mut self.db {
            db.note(finding);
        }
        let Finding { lost, damage } = finding;
        if self.found.contains(damage) {
            return;
        }
        tracing::error!("{damage}");
        self.found.push(damage.clone());
        let mut told = StoreDamage { problems: lines(&self.found), ..StoreDamage::default() };
        match lost {
            Lost::ModelSet(id) => told.model_sets.push(id.clone()),
            Lost::Samples(session) => told.sessions.push((*session, damage.reason.clone())),
            Lost::Structure => {}
        }
        (self.notify)(StoreEvent::Damaged(told));
    }

    /// Commits the group, then tells everyone.
    fn flush(&mut self) {
        let group = std::mem::take(&mut self.group).entries;
        if group.is_empty() {
            return;
        }
        let written = match &mut self.db {
            Ok(db) => {
                let kept = if db.is_on_disk() { Durability::OnDisk } else { Durability::InMemory };
                db.write(group.iter().flat_map(|entry| &entry.records)).map(|grown| (kept, grown))
            }
            Err(first) => Err(StoreError::ReadOnly { reason: first.to_string() }),
        };
        // The plain file of the active sets is on disk before whoever activated one learns that it is active.
        if let (Ok(_), Ok(db)) = (&written, &mut self.db) {
            db.keep_active();
        }
        // Whoever deleted something may rely on its bytes being gone. That the commit holds does not hang on it.
        let erased = match (&written, &mut self.db) {
            (Ok(_), Ok(db)) => db.erase(),
            _ => Ok(()),
        };
        let outcome = written.as_ref().map(|&(kept, _)| kept).map_err(Clone::clone);
        for entry in group {
            entry.waiting.tell(outcome.clone());
        }
        match written.and_then(|(_, grown)| erased.map(|()| grown)) {
            Ok(grown) => {
                for (session, samples) in grown {
                    (self.notify)(StoreEvent::Durable { session, samples });
                }
                // After the answers: what they promise does not hang on it.
                if let Ok(Err(error)) = self.db.as_ref().map(Db::checkpoint_if_long) {
                    self.fail(error);
                }
            }
            Err(error) => self.fail(error),
        }
    }

    /// Ends all writing; only the first failure counts.
    pub(crate) fn fail(&mut self, error: StoreError) {
        self.prove_at = None;
        let Ok(db) = &self.db else { return };
        let error = match error {
            StoreError::Corrupt(findings) => {
                db.doubt();
                StoreError::Corrupt(format!("{findings}; {MENDED_BY_A_RESTART}"))
            }
            other => other,
        };
        tracing::error!("{error}; nothing is stored any more until the programme is started again");
        (self.notify)(StoreEvent::Failed(error.to_string()));
        self.db = Err(error); // dropped, it writes and flushes nothing more
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Else the group grows as long as batches come faster than it can be asked for the next one.
    #[test]
    fn a_full_group_takes_no_more_of_what_waits() {
        let (queue, work) = work_queue();
        let batch = || Entry { records: Vec::new(), waiting: Waiting(None) };
        let mut writer = Writer::new(Db::in_memory().unwrap(), Vec::new(), Box::new(|_| ()));
        (0..QUEUE_BATCHES).for_each(|_| writer.group.push(batch()));
        assert!(queue.try_send(Work::Write(batch())).is_ok());
        assert!(matches!(writer.next(&work), Err(RecvTimeoutError::Timeout)));
        assert_eq!(queue.waiting(), 1);
        writer.flush();
        assert!(matches!(writer.next(&work), Ok(Work::Write(_))));
    }
}
