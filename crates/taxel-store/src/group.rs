//! Batches that go to disk together.

use std::time::{Duration, Instant};

use taxel_engine::record::Record;

use crate::work::Entry;

/// Samples that are committed together at most, and for how long the first of them waits at most. A flush costs
/// milliseconds; a crash costs no more than this.
const GROUP_SAMPLES: usize = 64;
const GROUP_WAIT: Duration = Duration::from_millis(100);

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

    pub(crate) fn is_full(&self) -> bool {
        self.samples >= GROUP_SAMPLES || self.entries.len() >= GROUP_SAMPLES
    }

    /// How long the next batch may still take to be part of it: if someone waits, only one that is there already.
    pub(crate) fn wait(&self) -> Option<Duration> {
        let since = self.since?;
        Some(if self.urgent { Duration::ZERO } else { GROUP_WAIT.saturating_sub(since.elapsed()) })
    }
}
