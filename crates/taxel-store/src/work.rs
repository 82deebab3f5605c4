//! What the store's thread is asked for, and the one queue in which that waits.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use taxel_engine::record::Record;
use thiserror::Error;

use crate::error::StoreError;

/// Batches that may wait for the disk.
///
/// Four patches at 100 scans a second and a disk that stalls for 5 s, as worn flash does: 2,000 batches. At about
/// 400 bytes a sample that is below 1 MB. More waiting means that the disk is gone, and then the caller has to know.
pub const QUEUE_BATCHES: usize = 2048;

/// Of these so many may wait before nothing more is taken of what people ask for: an answer and what a change brings with it
/// come on top of each, and the rest is for what happens by itself, such as samples, without which all writing ends.
pub const QUEUE_BATCHES_ASKED: usize = QUEUE_BATCHES / 4;

/// So many samples are not kept waiting for more, and the first of them waits for so long at most. A flush costs
/// milliseconds; a crash costs no more than this, but where more waits for the disk already.
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

/// Told once, most often on the store's thread, what was asked for, or why it cannot be had.
pub type Tell<T> = Box<dyn FnOnce(Result<T, StoreError>) + Send>;

/// Told once, on the store's thread, how its batch fared.
pub type OnDurable = Tell<Durability>;

/// Records that are stored together: all of them or none.
#[derive(Default)]
pub struct Batch {
    /// In the order they happened.
    pub records: Vec<Record>,
    /// Who waits for them. A batch with someone waiting is committed at once, with all that came before it; one
    /// without is committed with others, at most 100 ms later or once 64 samples are together and no more wait.
    pub on_durable: Option<OnDurable>,
}

impl fmt::Debug for Batch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch").field("records", &self.records).field("on_durable", &self.on_durable.is_some()).finish()
    }
}

/// The queue holds as much as it may; the batch is given back.
#[derive(Debug, Error)]
#[error("the store is behind: {most} batches wait for the disk")]
pub struct QueueFull {
    /// What was not taken.
    pub batch: Batch,
    /// So many batches may wait before one like this.
    pub most: usize,
}

/// Somebody who waits for an answer and always gets one: that the store is closed, if nothing else is told before.
pub(crate) struct Waiting<T>(pub(crate) Option<Tell<T>>);

impl<T> Waiting<T> {
    pub(crate) fn tell(mut self, outcome: Result<T, StoreError>) {
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
pub(crate) struct Entry {
    pub(crate) records: Vec<Record>,
    pub(crate) waiting: Waiting<Durability>,
}

/// What the store's thread is asked for, in one order; `A` is a question with what is done with the answer.
pub(crate) enum Work<A> {
    Write(Entry),
    Ask(A),
}

/// The end of the queue into which work is put.
pub(crate) struct WorkQueue<A> {
    work: SyncSender<Work<A>>,
    waiting: Arc<AtomicUsize>,
}

/// The other end, of the store's thread.
pub(crate) struct WorkSource<A> {
    work: Receiver<Work<A>>,
    waiting: Arc<AtomicUsize>,
}

/// A queue of [`QUEUE_BATCHES`].
pub(crate) fn work_queue<A>() -> (WorkQueue<A>, WorkSource<A>) {
    let (sender, work) = sync_channel(QUEUE_BATCHES);
    let waiting = Arc::new(AtomicUsize::new(0));
    (WorkQueue { work: sender, waiting: Arc::clone(&waiting) }, WorkSource { work, waiting })
}

impl<A> fmt::Debug for WorkQueue<A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("WorkQueue").field("waiting", &self.waiting()).finish_non_exhaustive()
    }
}

impl<A> WorkQueue<A> {
    /// Puts work in, or gives it back. Never waits.
    pub(crate) fn try_send(&self, work: Work<A>) -> Result<(), TrySendError<Work<A>>> {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        self.work.try_send(work).inspect_err(|_| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        })
    }

    /// How much work waits.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }
}

impl<A> WorkSource<A> {
    /// The next work, which is waited for: so long at most, or for ever.
    ///
    /// # Errors
    /// That none came in time, or that none will come any more.
    pub(crate) fn next(&self, most: Option<Duration>) -> Result<Work<A>, RecvTimeoutError> {
        let next = match most {
            Some(most) => self.work.recv_timeout(most),
            None => self.work.recv().map_err(RecvTimeoutError::from),
        };
        next.inspect(|_| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        })
    }

    /// Whether work waits.
    pub(crate) fn is_waiting(&self) -> bool {
        self.waiting.load(Ordering::Relaxed) > 0
    }
}

/// Batches that go to disk in one transaction.
#[derive(Default)]
pub(crate) struct Group {
    pub(crate) entries: Vec<Entry>,
    samples: usize,
    /// When the first of them came.
    since: Option<Instant>,
    /// Whether someone waits.
    urgent: bool,
}

impl Group {
    pub(crate) fn push(&mut self, entry: Entry) {
        self.samples += entry.records.iter().filter(|record| matches!(record, Record::Sample { .. })).count();
        self.since.get_or_insert_with(Instant::now);
        self.urgent |= entry.waiting.0.is_some();
        self.entries.push(entry);
    }

    /// How long the next batch may still take to be part of it: if someone waits, or it is worth a flush, only one that is
    /// there already. On a disk that takes seconds for a flush all that has come meanwhile goes with the next one.
    pub(crate) fn wait(&self) -> Option<Duration> {
        let since = self.since?;
        let is_worth_it = self.samples >= GROUP_SAMPLES || self.entries.len() >= GROUP_SAMPLES;
        Some(if self.urgent || is_worth_it { Duration::ZERO } else { GROUP_WAIT.saturating_sub(since.elapsed()) })
    }

    /// Whether it takes no more: all that may wait for the disk is in it.
    pub(crate) fn is_full(&self) -> bool {
        self.entries.len() >= QUEUE_BATCHES
    }
}
