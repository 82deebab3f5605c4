//! What a store would have: records in order, of which a prefix is on disk.

use std::collections::BTreeMap;

use taxel_engine::Restored;
use taxel_engine::record::Record;

use crate::disk::{Disk, configured};
use crate::world::{PATCH, plan};

#[derive(Default)]
pub struct Store {
    records: Vec<Record>,
    on_disk: usize,
}

impl Store {
    pub fn push(&mut self, record: Record) {
        self.records.push(record);
    }

    pub fn len(&self) -> usize {
        self.records.len()
    }

    pub fn on_disk(&self) -> &[Record] {
        &self.records[..self.on_disk]
    }

    /// All records, whether they are on disk or wait for it.
    pub fn all(&self) -> Disk {
        Disk::of(&self.records)
    }

    /// Everything is written; the samples of each session that are on disk now.
    pub fn write(&mut self) -> BTreeMap<u64, u64> {
        self.on_disk = self.records.len();
        let samples = self.on_disk().iter().filter_map(|record| match record {
            Record::Sample { session, index, .. } => Some((*session, index + 1)),
            _ => None,
        });
        samples.collect()
    }

    /// What a start finds: as with the real store a set is in memory if it is in use. No zero is kept.
    pub fn restore(&mut self) -> Restored {
        self.records.truncate(self.on_disk);
        let mut found = self.all().found();
        for known in &mut found.model_sets {
            known.at_hand.take_if(|set| found.active.iter().all(|(_, id)| *id != set.id));
        }
        found.zeros = vec![(PATCH.to_owned(), configured(&plan().patches[0]))];
        found
    }
}
