//! The handle to the store's thread, and what reads from it.

use std::path::Path;
use std::sync::mpsc::TrySendError;
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;

use taxel_engine::Restored;
use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;

use crate::db::Db;
use crate::error::{Quarantined, StoreError};
use crate::open::{Opened, open};
use crate::retention::{Retention, Size};
use crate::thread::{Ask, Notify, Turn, Writer};
use crate::work::{
    Batch, Entry, QUEUE_BATCHES, QUEUE_BATCHES_ASKED, QueueFull, Tell, Waiting, Work, WorkQueue, work_queue,
};

/// The handle to the thread. All methods return at once, but [`Store::open`] and [`Store::close`].
#[derive(Debug)]
pub struct Store {
    /// The thread holds the receiver; dropping this ends it after a last flush.
    queue: Arc<WorkQueue<Ask>>,
    /// Its result is that of the last flush.
    thread: JoinHandle<Result<(), StoreError>>,
}

impl Store {
    /// Opens or creates the store at `path` and starts its thread.
    ///
    /// Gives what the engine starts from, and what was found damaged or lost: all of that, where the lines in
    /// [`Restored::problems`] are bounded. A file that is damaged, or older than its copy, is set aside, and the copy takes its
    /// place.
    ///
    /// Where the disk takes nothing, what can be read is handed out all the same: [`StoreEvent::Failed`](crate::StoreEvent::Failed) comes at once, and
    /// every batch is refused with the reason.
    ///
    /// # Errors
    /// [`StoreError`] if the file is another process's, another programme's or a newer version's; or if it cannot be read, and
    /// its copy neither.
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
        let Opened { db, restored, findings } = open(path, limits)?;
        Ok((Self::start(db, findings.clone(), notify)?, restored, findings))
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
        let Opened { db, restored, .. } = open(path, &Retention::default())?;
        let now: u32 = db.connection.pragma_query_value(None, "page_count", |row| row.get(0))?;
        db.connection.pragma_update_and_check(None, "max_page_count", now + pages, |_| Ok(()))?;
        Ok((Self::start(db, Vec::new(), notify)?, restored))
    }

    fn start(db: Db, found: Vec<Quarantined>, notify: Notify) -> Result<Self, StoreError> {
        let (queue, work) = work_queue();
        let writer = Writer::new(db, found, notify);
        let thread = std::thread::Builder::new()
            .name("store".to_owned())
            .spawn(move || writer.run(&work))
            .map_err(|error| StoreError::Io(format!("cannot start its thread: {error}")))?;
        Ok(Self { queue: Arc::new(queue), thread })
    }

    /// Hands a batch to the thread. Never waits.
    ///
    /// # Errors
    /// [`QueueFull`] with the batch, nothing of which is stored.
    pub fn submit(&self, Batch { records, on_durable }: Batch) -> Result<(), QueueFull> {
        match self.queue.try_send(Work::Write(Entry { records, waiting: Waiting(on_durable) })) {
            Err(TrySendError::Full(Work::Write(Entry { records, mut waiting }))) => {
                Err(QueueFull { batch: Batch { records, on_durable: waiting.0.take() }, most: QUEUE_BATCHES })
            }
            _ => Ok(()), // whoever waits for a thread that has ended was told as this was dropped
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
pub struct Reader(Weak<WorkQueue<Ask>>);

impl Reader {
    /// The samples of a session.
    pub fn samples(&self, session: u64, tell: Tell<SessionSamples>) {
        self.ask(tell, move |turn| turn.samples(session));
    }

    /// The text of a model set as it was written, MODELS.json.
    pub fn model_set(&self, id: String, tell: Tell<String>) {
        self.ask(tell, move |turn| turn.model_set(id));
    }

    /// Entries of the audit log with numbers below `before`, newest first: at most so many, and at most 1000.
    pub fn audit(&self, before: u64, most: u32, tell: Tell<Vec<AuditEntry>>) {
        self.ask(tell, move |turn| turn.audit(before, most));
    }

    /// How much there is.
    pub fn size(&self, tell: Tell<Size>) {
        self.ask(tell, |turn| turn.size());
    }

    fn ask<T: 'static>(&self, tell: Tell<T>, read: impl FnOnce(Turn<'_>) -> Result<T, StoreError> + Send + 'static) {
        let Some(queue) = self.0.upgrade() else { return tell(Err(StoreError::Closed)) };
        let waiting = Waiting(Some(tell));
        let ask: Ask = Box::new(move |turn| waiting.tell(turn.and_then(read)));
        if let Err(TrySendError::Full(Work::Ask(ask))) = queue.try_send(Work::Ask(ask)) {
            ask(Err(StoreError::Behind { waiting: QUEUE_BATCHES }));
        }
    }
}
