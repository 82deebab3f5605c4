//! Batches that go to disk together.

use std::time::{Duration, Instant};

use taxel_engine::record::Record;

use crate::work::{Entry, QUEUE_BATCHES};

/// So many samples are not kept waiting for more, and the first of them waits for so long at most. A flush costs
/// milliseconds; a crash costs no more than this, but where more waits for the disk already.
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

    /// Whether it takes no more: all that may wait for the disk is in it.
    pub(crate) fn is_full(&self) -> bool {
        self.entries.len() >= QUEUE_BATCHES
    }

    /// How long the next batch may still take to be part of it: if someone waits, or it is worth a flush, only one that is
    /// there already. On a disk that takes seconds for a flush all that has come meanwhile goes with the next one.
    pub(crate) fn wait(&self) -> Option<Duration> {
        let since = self.since?;
        let is_worth_it = self.samples >= GROUP_SAMPLES || self.entries.len() >= GROUP_SAMPLES;
        Some(if self.urgent || is_worth_it { Duration::ZERO } else { GROUP_WAIT.saturating_sub(since.elapsed()) })
    }
}

#[cfg(test)]
mod tests {
    use taxel_engine::calibration::Sample;

    use super::*;
    use crate::work::Waiting;

    fn batch(samples: usize, waits: bool) -> Entry {
        let sample = || Sample { ramp: 0, time_ns: 0, pressure_kpa: 1.0, counts: [0_u8].as_slice().into() };
        let records = (0..samples).map(|index| Record::Sample { session: 1, index: index as u64, sample: sample() });
        Entry {
            records: records.collect(),
            waiting: Waiting(waits.then(|| -> crate::work::Tell<_> { Box::new(|_| ()) })),
        }
    }

    #[test]
    fn a_group_waits_until_someone_does_or_it_is_worth_a_flush() {
        let after = |batches: Vec<Entry>| {
            let mut group = Group::default();
            batches.into_iter().for_each(|batch| group.push(batch));
            group.wait()
        };
        assert_eq!(after(Vec::new()), None);
        assert!(after(vec![batch(GROUP_SAMPLES - 1, false)]).is_some_and(|wait| wait <= GROUP_WAIT));
        assert_eq!(after(vec![batch(1, false), batch(0, true)]), Some(Duration::ZERO), "someone waits");
        assert_eq!(after(vec![batch(GROUP_SAMPLES - 1, false), batch(1, false)]), Some(Duration::ZERO));
        assert_eq!(after((0..GROUP_SAMPLES).map(|_| batch(0, false)).collect()), Some(Duration::ZERO));
    }

    #[test]
    fn a_group_is_full_with_all_that_may_wait_for_the_disk() {
        let mut group = Group::default();
        (1..QUEUE_BATCHES).for_each(|_| group.push(batch(0, false)));
        assert!(!group.is_full());
        group.push(batch(0, false));
        assert!(group.is_full());
    }
}
