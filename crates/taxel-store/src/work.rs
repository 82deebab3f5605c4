//! What the store's thread is asked for, and who waits for it.

use std::fmt;
use std::time::{Duration, Instant};

use taxel_engine::record::Record;
use thiserror::Error;

use crate::error::StoreError;

/// Batches that may wait for the disk.
///
/// Four patches at 100 scans a second and a disk that stalls for 5 s, as worn flash does: 2,000 batches. At about
/// 600 bytes a sample that is little more than 1 MB. More waiting means that the disk is gone, and then the caller has to know.
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
