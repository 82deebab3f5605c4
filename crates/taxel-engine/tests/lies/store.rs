//! The daemon's store as a simulation sees it: what has reached the disk, and what is on its way.

use std::collections::VecDeque;

use taxel_engine::record::Record;
use taxel_skin::Time;

use crate::disk::Disk;

/// Records on disk, and records that wait for it in order.
#[derive(Debug, Default)]
pub struct Store {
    pub disk: Disk,
    waiting: VecDeque<(Time, Record)>,
    /// It takes nothing any more.
    pub failed: bool,
    /// What was found of a board's zero did not reach the disk before the daemon stopped.
    forgotten: bool,
    /// The same, of the daemon that runs.
    unwritten: bool,
}

impl Store {
    pub fn with(disk: Disk) -> Self {
        Self { disk, ..Self::default() }
    }

    /// Will be on disk at `due`, after all that came before; when that is, if the store takes it.
    pub fn take(&mut self, due: Time, record: Record) -> Option<Time> {
        if self.failed {
            self.unwritten |= finds_a_load(&record);
            return None;
        }
        let due = self.answers_at(due);
        self.waiting.push_back((due, record));
        Some(due)
    }

    /// When a question that is asked at `due` is answered: after all that came before is on disk.
    pub fn answers_at(&self, due: Time) -> Time {
        self.waiting.back().map_or(due, |(last, _)| due.max(*last))
    }

    /// Writes what is due; for each session of which samples were written, their number.
    pub fn write(&mut self, now: Time) -> Vec<(u64, u64)> {
        let mut written: Vec<(u64, u64)> = Vec::new();
        while self.waiting.front().is_some_and(|(due, _)| *due <= now) {
            let Some((_, record)) = self.waiting.pop_front() else { break };
            if let Record::Sample { session, index, .. } = &record {
                match written.last_mut().filter(|(last, _)| last == session) {
                    Some((_, samples)) => *samples = index + 1,
                    None => written.push((*session, index + 1)),
                }
            }
            self.disk.write(record);
        }
        written
    }

    /// The daemon stopped: what had not reached the disk is lost.
    pub fn lose_waiting(&mut self) {
        let finds = self.waiting.iter().any(|(_, record)| finds_a_load(record));
        self.forgotten |= finds || std::mem::take(&mut self.unwritten);
        self.waiting.clear();
    }

    /// Whether a daemon that ran before had found that a board's zero holds a load, and the disk did not get it.
    pub const fn has_forgotten(&self) -> bool {
        self.forgotten
    }
}

/// Whether it was found that a board's zero may hold a load.
fn finds_a_load(record: &Record) -> bool {
    matches!(record, Record::Zero { zero, .. } if zero.needs_confirmation.is_some())
}
