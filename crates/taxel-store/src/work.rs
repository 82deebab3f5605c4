//! What the store's thread is asked for, and the queue in which that waits.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use taxel_engine::audit::AuditEntry;
use taxel_engine::calibration::SessionSamples;
use taxel_engine::record::Record;
use thiserror::Error;

use crate::error::StoreError;
use crate::retention::Size;

/// Batches that may wait for the disk.
///
/// Four patches at 100 scans a second and a disk that stalls for 5 s, as worn flash does: 2,000 batches. At about
/// 400 bytes a sample that is below 1 MB. More waiting means that the disk is gone, and then the caller has to know.
pub const QUEUE_BATCHES: usize = 2048;

/// Of these so many may wait before nothing more is taken of what people ask for: an answer and what a change brings with it
/// come on top of each, and the rest is for what happens by itself, such as samples, without which all writing ends.
pub const QUEUE_BATCHES_ASKED: usize = QUEUE_BATCHES / 4;

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

/// Told once, on the writer's thread, the text of a model set, or why it cannot be had.
pub type OnModelSet = Box<dyn FnOnce(Result<String, StoreError>) + Send>;

/// Told once, on the writer's thread, entries of the audit log, or why they cannot be had.
pub type OnAudit = Box<dyn FnOnce(Result<Vec<AuditEntry>, StoreError>) + Send>;

/// Told once, on the writer's thread, what the store holds, or why that cannot be had.
pub type OnSize = Box<dyn FnOnce(Result<Size, StoreError>) + Send>;

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

/// What is done with an answer.
pub(crate) type Tell<T> = Box<dyn FnOnce(Result<T, StoreError>) + Send>;

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

/// What the writer's thread is asked for.
pub(crate) enum Work {
    Write(Entry),
    Read { session: u64, waiting: Waiting<SessionSamples> },
    ReadSet { model_set: String, waiting: Waiting<String> },
    Audit { before: u64, most: u32, waiting: Waiting<Vec<AuditEntry>> },
    Size { waiting: Waiting<Size> },
}

impl Work {
    pub(crate) fn into_batch(self) -> Batch {
        match self {
            Self::Write(Entry { records, mut waiting }) => Batch { records, on_durable: waiting.0.take() },
            Self::Read { .. } | Self::ReadSet { .. } | Self::Audit { .. } | Self::Size { .. } => Batch::default(),
        }
    }
}

/// The end of the queue into which work is put. It also tells whether work waits, which the other end cannot see.
#[derive(Debug)]
pub(crate) struct WorkQueue {
    work: SyncSender<Work>,
    waiting: Arc<AtomicUsize>,
}

/// The other end, of the store's thread.
pub(crate) struct WorkSource {
    work: Receiver<Work>,
    waiting: Arc<AtomicUsize>,
}

/// A queue of [`QUEUE_BATCHES`].
pub(crate) fn work_queue() -> (WorkQueue, WorkSource) {
    let (sender, work) = sync_channel(QUEUE_BATCHES);
    let waiting = Arc::new(AtomicUsize::new(0));
    (WorkQueue { work: sender, waiting: Arc::clone(&waiting) }, WorkSource { work, waiting })
}

impl WorkQueue {
    /// Puts work in, or gives it back. Never waits.
    pub(crate) fn try_send(&self, work: Work) -> Result<(), TrySendError<Work>> {
        self.waiting.fetch_add(1, Ordering::Relaxed);
        self.work.try_send(work).inspect_err(|_| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        })
    }

    /// How much work waits.
    pub(crate) fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Asks for something; whoever asks is told if there is no room for it.
    pub(crate) fn ask<T>(
        &self,
        tell: Tell<T>,
        work: impl FnOnce(Waiting<T>) -> Work,
        refused: fn(Work) -> Option<Waiting<T>>,
    ) {
        if let Err(TrySendError::Full(work)) = self.try_send(work(Waiting(Some(tell))))
            && let Some(waiting) = refused(work)
        {
            waiting.tell(Err(StoreError::Behind { waiting: QUEUE_BATCHES }));
        }
    }
}

/// The end of the queue is work, too: whoever waits for it is not kept waiting.
impl Drop for WorkQueue {
    fn drop(&mut self) {
        self.waiting.fetch_add(1, Ordering::Relaxed);
    }
}

impl WorkSource {
    /// The next work, which is waited for: so long at most, or for ever.
    ///
    /// # Errors
    /// That none came in time, or that none will come any more.
    pub(crate) fn next(&self, most: Option<Duration>) -> Result<Work, RecvTimeoutError> {
        let next = match most {
            Some(most) => self.work.recv_timeout(most),
            None => self.work.recv().map_err(RecvTimeoutError::from),
        };
        next.inspect(|_| {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        })
    }

    /// Tells whether work waits.
    pub(crate) fn look(&self) -> impl Fn() -> bool + Send + use<> {
        let waiting = Arc::clone(&self.waiting);
        move || waiting.load(Ordering::Relaxed) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> Work {
        Work::Write(Entry { records: Vec::new(), waiting: Waiting(None) })
    }

    #[test]
    fn the_end_of_the_queue_is_work_too() {
        let (queue, source) = work_queue();
        let waits = source.look();
        assert!(!waits());
        assert!(queue.try_send(entry()).is_ok());
        assert!(waits() && queue.waiting() == 1);
        assert!(source.next(None).is_ok());
        assert!(!waits());
        assert!(matches!(source.next(Some(Duration::ZERO)), Err(RecvTimeoutError::Timeout)));
        assert!(!waits(), "nothing was taken");
        drop(queue);
        assert!(waits(), "whoever closes the store waits for its thread");
    }

    #[test]
    fn a_full_queue_gives_the_work_back_and_counts_it_no_more() {
        let (queue, _source) = work_queue();
        (0..QUEUE_BATCHES).for_each(|_| assert!(queue.try_send(entry()).is_ok()));
        assert!(queue.try_send(entry()).is_err());
        assert_eq!(queue.waiting(), QUEUE_BATCHES);
    }
}
