//! One thread owns the file. Batches come in through a bounded queue, acknowledgements go out from the thread itself.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use taxel_engine::Restored;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::record::Record;
use thiserror::Error;

use crate::db::Db;
use crate::error::{Quarantined, StoreError};

/// Batches that may wait for the disk.
///
/// Four patches at 100 scans a second and a disk that stalls for 5 s, as worn flash does: 2,000 batches. At about
/// 400 bytes a sample that is below 1 MB. More waiting means that the disk is gone, and then the caller has to know.
pub const QUEUE_BATCHES: usize = 2048;

/// Samples that are committed together at most, and for how long the first of them waits at most. A flush costs
/// milliseconds; a crash costs no more than this.
const GROUP_SAMPLES: usize = 64;
const GROUP_WAIT: Duration = Duration::from_millis(100);

/// How an acknowledged batch is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// On disk: the commit returned, with the file flushed.
    OnDisk,
    /// In a store that ends with the process.
    InMemory,
}

/// Told once, on the writer's thread, how its batch fared.
pub type OnDurable = Box<dyn FnOnce(Result<Durability, StoreError>) + Send>;

/// Told once, most often on the writer's thread, what a session gathered, or why that cannot be had.
pub type OnSamples = Box<dyn FnOnce(Result<SessionSamples, StoreError>) + Send>;

/// Records that are stored together: all of them or none.
#[derive(Default)]
pub struct Batch {
    /// In the order they happened.
    pub records: Vec<Record>,
    /// Who waits for them. A batch with someone waiting is committed at once, with all that came before it; one
    /// without is committed with others, at most 100 ms or 64 samples later.
    pub on_durable: Option<OnDurable>,
}

impl fmt::Debug for Batch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch").field("records", &self.records).field("on_durable", &self.on_durable.is_some()).finish()
    }
}

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
}

/// Who hears the [`StoreEvent`]s. It runs between commits and must not wait.
pub type Notify = Box<dyn Fn(StoreEvent) + Send>;

/// The queue holds as much as it may; the batch is given back.
#[derive(Debug, Error)]
#[error("the store is behind: {QUEUE_BATCHES} batches wait for the disk")]
pub struct QueueFull(pub Batch);

/// The handle to the writer. All methods return at once, but [`Store::open`] and [`Store::close`].
#[derive(Debug)]
pub struct Store {
    /// The writer's thread holds the receiver; dropping this ends it after a last flush.
    queue: SyncSender<Work>,
    /// Its result is that of the last flush.
    thread: JoinHandle<Result<(), StoreError>>,
}

impl Store {
    /// Opens or creates the store at `path`, checks all of it and starts its writer.
    ///
    /// Gives what the engine starts from, and what was found damaged and left out of it: all of that, where the lines in
    /// [`Restored::problems`] are bounded.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be opened, is another process's, another programme's or a newer version's, or
    /// if its structure is broken.
    pub fn open(path: &Path, notify: Notify) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        let (db, restored, quarantined) = Db::open(path)?;
        for damage in &quarantined {
            tracing::error!(store = %path.display(), "{damage}");
        }
        Ok((Self::start(db, notify)?, restored, quarantined))
    }

    /// A store that ends with the process, for the demo and for tests.
    ///
    /// # Errors
    /// [`StoreError::Io`] if memory or a thread is not to be had.
    pub fn in_memory(notify: Notify) -> Result<Self, StoreError> {
        Self::start(Db::in_memory()?, notify)
    }

    /// As [`Store::open`], but the file may grow by no more than so many pages of 4 KiB: for tests that meet a full disk.
    ///
    /// # Errors
    /// As [`Store::open`].
    #[cfg(any(test, feature = "fixtures"))]
    pub fn open_with_room(path: &Path, pages: u32, notify: Notify) -> Result<(Self, Restored), StoreError> {
        let (db, restored, _) = Db::open(path)?;
        db.limit_growth(pages.into())?;
        Ok((Self::start(db, notify)?, restored))
    }

    pub(crate) fn start(db: Db, notify: Notify) -> Result<Self, StoreError> {
        let (queue, work) = sync_channel(QUEUE_BATCHES);
        let writer = Writer { db: Ok(db), notify, group: Group::default() };
        let thread = std::thread::Builder::new()
            .name("store".to_owned())
            .spawn(move || writer.run(&work))
            .map_err(|error| StoreError::Io(format!("cannot start its thread: {error}")))?;
        Ok(Self { queue, thread })
    }

    /// Hands a batch to the writer. Never waits.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit(&self, batch: Batch) -> Result<(), QueueFull> {
        let Batch { records, on_durable } = batch;
        match self.queue.try_send(Work::Write(Entry { records, waiting: Waiting(on_durable) })) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(work)) => Err(QueueFull(work.into_batch())),
            Err(TrySendError::Disconnected(_)) => Ok(()), // whoever waits was told as this was dropped
        }
    }

    /// Reads the samples of a session, after all that was submitted before. Never waits.
    pub fn read_samples(&self, session: u64, on_samples: OnSamples) {
        let work = Work::Read { session, waiting: Waiting(Some(on_samples)) };
        if let Err(TrySendError::Full(Work::Read { waiting, .. })) = self.queue.try_send(work) {
            waiting.tell(Err(StoreError::Behind { waiting: QUEUE_BATCHES }));
        }
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

/// What is done with an answer.
type Tell<T> = Box<dyn FnOnce(Result<T, StoreError>) + Send>;

/// Somebody who waits for an answer and always gets one: that the store is closed, if nothing else is told before.
struct Waiting<T>(Option<Tell<T>>);

impl<T> Waiting<T> {
    fn tell(mut self, outcome: Result<T, StoreError>) {
        if let Some(tell) = self.0.take() {
            tell(outcome);
        }
    }
}

impl<T> Drop for Waiting<T> {
    fn drop(&mut self) {
        if let Some(tell) = self.0.take() {
            tell(Err(StoreError::Closed));
        }
    }
}

/// A batch on its way to the disk.
struct Entry {
    records: Vec<Record>,
    waiting: Waiting<Durability>,
}

/// What the writer's thread is asked for.
enum Work {
    Write(Entry),
    Read { session: u64, waiting: Waiting<SessionSamples> },
}

impl Work {
    fn into_batch(self) -> Batch {
        match self {
            Self::Write(Entry { records, mut waiting }) => Batch { records, on_durable: waiting.0.take() },
            Self::Read { .. } => Batch::default(),
        }
    }
}

/// Batches that go to disk in one transaction.
#[derive(Default)]
struct Group {
    entries: Vec<Entry>,
    samples: usize,
    /// When the first of them came.
    since: Option<Instant>,
    /// Whether someone waits.
    urgent: bool,
}

impl Group {
    fn push(&mut self, entry: Entry) {
        self.samples += entry.records.iter().filter(|record| matches!(record, Record::Sample { .. })).count();
        self.since.get_or_insert_with(Instant::now);
        self.urgent |= entry.waiting.0.is_some();
        self.entries.push(entry);
    }

    fn is_full(&self) -> bool {
        self.samples >= GROUP_SAMPLES || self.entries.len() >= GROUP_SAMPLES
    }

    /// How long the next batch may still take to be part of it: if someone waits, only one that is there already.
    fn wait(&self) -> Option<Duration> {
        let since = self.since?;
        Some(if self.urgent { Duration::ZERO } else { GROUP_WAIT.saturating_sub(since.elapsed()) })
    }
}

/// The thread's state.
struct Writer {
    /// The file, or the first failure, after which nothing is tried again: once a flush has failed, the kernel may
    /// have dropped what it could not write, and a second flush would succeed without it.
    db: Result<Db, StoreError>,
    notify: Notify,
    group: Group,
}

impl Writer {
    fn run(mut self, work: &Receiver<Work>) -> Result<(), StoreError> {
        // A fault of this programme ends all writing, as a failing disk does, and nobody waits for ever.
        while catch_unwind(AssertUnwindSafe(|| self.serve(work))).is_err() {
            self.fail(StoreError::Panicked);
        }
        self.db.and_then(Db::close)
    }

    fn serve(&mut self, work: &Receiver<Work>) {
        loop {
            let next = match self.group.wait() {
                None => work.recv().map_err(|_| RecvTimeoutError::Disconnected),
                Some(_) if self.group.is_full() => Err(RecvTimeoutError::Timeout),
                Some(wait) => work.recv_timeout(wait),
            };
            match next {
                Ok(Work::Write(entry)) => self.group.push(entry),
                Ok(Work::Read { session, waiting }) => {
                    self.flush();
                    waiting.tell(self.read(session));
                }
                Err(RecvTimeoutError::Timeout) => self.flush(),
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.flush();
    }

    fn read(&self, session: u64) -> Result<SessionSamples, StoreError> {
        match &self.db {
            Ok(db) => db.samples(session).map_err(|findings| StoreError::DamagedSamples { session, findings }),
            Err(first) => Err(StoreError::ReadOnly { reason: first.to_string() }),
        }
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
    fn fail(&mut self, error: StoreError) {
        if self.db.is_err() {
            return;
        }
        tracing::error!("{error}; nothing is stored any more until the programme is started again");
        (self.notify)(StoreEvent::Failed(error.to_string()));
        if let Ok(db) = std::mem::replace(&mut self.db, Err(error)) {
            db.abandon();
        }
    }
}
