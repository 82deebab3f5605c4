//! The handle to the store's thread, and what reads from it.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;

use rusqlite::Connection;
use taxel_engine::Restored;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;

use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::open::{Opened, open};
use crate::thread::{Notify, Work, WorkSource, Writer, run};
use crate::work::{Batch, Entry, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, QueueFull, Tell, Waiting};

/// The handle to the thread. All methods return at once, but [`Store::open`] and [`Store::close`].
#[derive(Debug)]
pub struct Store {
    /// The thread holds the receiver; dropping this ends it after a last flush.
    queue: Arc<Queue>,
    /// Its result is that of the last flush.
    thread: JoinHandle<Result<(), StoreError>>,
}

#[derive(Debug)]
struct Queue {
    work: Sender<Work>,
    waiting: Arc<AtomicUsize>,
}

impl Queue {
    /// Takes a place for work, while fewer than so many are taken.
    fn has_place(&self, most: usize) -> bool {
        let has_place = self.waiting.fetch_add(1, Ordering::Relaxed) < most;
        if !has_place {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
        has_place
    }

    fn put(&self, work: Work) {
        let _ = self.work.send(work); // a caller that waits for a thread that has ended sees this being dropped
    }
}

impl Store {
    /// Opens or creates the store at `path` and starts its thread.
    ///
    /// Gives what the engine starts from, and what was found damaged or lost: that is also in [`Restored::problems`]. A file that
    /// is damaged, or older than its copy, is set aside, and the copy takes its place.
    ///
    /// Where the disk takes nothing, what can be read is handed out all the same: [`StoreEvent::Failed`](crate::StoreEvent::Failed) comes at once, and
    /// every batch is refused with the reason.
    ///
    /// # Errors
    /// [`StoreError`] if the file is another process's, another programme's or a newer version's; or if it cannot be read, and
    /// its copy neither.
    pub fn open(path: &Path, notify: Notify) -> Result<(Self, Restored, Vec<Quarantined>), StoreError> {
        let Opened { db, restored, findings } = open(path)?;
        Ok((Self::start(db, findings.clone(), notify)?, restored, findings))
    }

    /// A store that ends with the process, for the demo and for tests.
    ///
    /// # Errors
    /// [`StoreError::Disk`] if memory or a thread is not to be had.
    pub fn in_memory(notify: Notify) -> Result<Self, StoreError> {
        Self::start(Db::in_memory()?, Vec::new(), notify)
    }

    fn start(db: Db, found: Vec<Quarantined>, notify: Notify) -> Result<Self, StoreError> {
        let (sender, work) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let source = WorkSource { work, waiting: Arc::clone(&waiting) };
        let thread = std::thread::Builder::new()
            .name("store".to_owned())
            .spawn(move || run(db, found, notify, &source))
            .map_err(|error| StoreError::Disk(format!("cannot start its thread: {error}")))?;
        Ok(Self { queue: Arc::new(Queue { work: sender, waiting }), thread })
    }

    /// Hands a batch to the thread. Never waits.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit(&self, batch: Batch) -> Result<(), QueueFull> {
        self.submit_within(batch, QUEUE_BATCHES)
    }

    /// As [`Store::submit`], for what somebody asks for: it is refused while more than [`QUEUE_BATCHES_ASKED`] wait, so that
    /// many queries on a slow disk take no room from what must be stored.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit_asked(&self, batch: Batch) -> Result<(), QueueFull> {
        self.submit_within(batch, QUEUE_BATCHES_ASKED)
    }

    fn submit_within(&self, batch: Batch, most: usize) -> Result<(), QueueFull> {
        if !self.queue.has_place(most) {
            return Err(QueueFull { batch, most });
        }
        self.queue.put(Work::Write(Entry { records: batch.records, waiting: Waiting(batch.on_durable) }));
        Ok(())
    }

    /// What reads from the store.
    #[must_use]
    pub fn reader(&self) -> Reader {
        Reader(Arc::downgrade(&self.queue))
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

/// Reads from a store, after all that was submitted before. It does not keep the store open, and is cheap to clone; of a store
/// that is closed the answer is [`StoreError::Closed`]. No method waits.
#[derive(Clone, Debug)]
pub struct Reader(Weak<Queue>);

impl Reader {
    /// The samples of a session.
    pub fn samples(&self, session: u64, tell: Tell<SessionSamples>) {
        self.ask(tell, move |connection, writer| writer.samples(connection, session));
    }

    /// The text of a model set as it was written, MODELS.json.
    pub fn model_set(&self, id: String, tell: Tell<String>) {
        self.ask(tell, move |connection, writer| writer.model_set(connection, id));
    }

    /// Entries of the audit log with numbers below `before`, newest first: at most so many, and at most 1000.
    pub fn audit(&self, before: u64, most: u32, tell: Tell<Vec<AuditEntry>>) {
        self.ask(tell, move |connection, writer| writer.audit(connection, before, most));
    }

    /// Bytes of the database that are in use.
    pub fn size(&self, tell: Tell<u64>) {
        self.ask(tell, |connection, writer| writer.size(connection));
    }

    fn ask<T: 'static>(
        &self,
        tell: Tell<T>,
        read: impl FnOnce(&Connection, &mut Writer) -> Result<T, StoreError> + Send + 'static,
    ) {
        let Some(queue) = self.0.upgrade() else { return tell(Err(StoreError::Closed)) };
        if !queue.has_place(QUEUE_BATCHES) {
            return tell(Err(StoreError::Behind { waiting: QUEUE_BATCHES }));
        }
        let waiting = Waiting(Some(tell));
        queue.put(Work::Ask(Box::new(move |connection, writer| waiting.tell(read(connection, writer)))));
    }
}
