//! What a store would have: records in order, of which a prefix is on disk.

use std::collections::BTreeMap;
use std::sync::Arc;

use taxel_engine::calibration::{RampBaseline, SessionSamples, SessionState, SessionView};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::Record;
use taxel_engine::{Restored, RestoredSession};

use crate::world::PATCH;

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

    /// Everything is written; the samples of each session that are on disk now.
    pub fn write(&mut self) -> BTreeMap<u64, u64> {
        self.on_disk = self.records.len();
        let mut samples = BTreeMap::new();
        for record in self.on_disk() {
            if let Record::Sample { session, index, .. } = record {
                samples.insert(*session, index + 1);
            }
        }
        samples
    }

    /// What a start finds, as the real store's `restore` does it.
    pub fn restore(&mut self) -> Restored {
        self.records.truncate(self.on_disk);
        let mut views: BTreeMap<u64, SessionView> = BTreeMap::new();
        let mut samples: BTreeMap<u64, SessionSamples> = BTreeMap::new();
        let mut model_sets: Vec<Arc<ModelSet>> = Vec::new();
        let mut active = Vec::new();
        for record in self.on_disk() {
            match record {
                Record::Session(view) => drop(views.insert(view.number, SessionView::clone(view))),
                Record::Ramp { session, ramp, baseline } => {
                    let ramp = RampBaseline { ramp: *ramp, taxels: baseline.clone() };
                    samples.entry(*session).or_default().ramps.push(ramp);
                }
                Record::Sample { session, index, sample } => {
                    let samples = &mut samples.entry(*session).or_default().samples;
                    assert_eq!(samples.len() as u64, *index, "samples of session {session} have gaps");
                    samples.push(sample.clone());
                }
                Record::ModelSet(set) if model_sets.iter().any(|known| known.id == set.id) => {}
                Record::ModelSet(set) => model_sets.push(Arc::clone(set)),
                Record::Activated { model_set, .. } => active = vec![(PATCH.to_owned(), model_set.clone())],
                Record::Load(_) | Record::Tared { .. } => {}
            }
        }
        let newest = views.keys().next_back().copied();
        let restored = |(number, mut view): (u64, SessionView)| {
            let gathered = samples.remove(&number).unwrap_or_default();
            if view.state.is_open() {
                view.state = SessionState::Interrupted;
            }
            if view.state == SessionState::Interrupted {
                view.ramps = gathered.ramps.len() as u16;
                view.accepted = gathered.samples.len() as u64;
                view.durable = view.accepted;
            }
            let waits = matches!(view.state, SessionState::Review | SessionState::Failed | SessionState::Aborted);
            let goes_on = view.state == SessionState::Interrupted || (waits && Some(number) == newest);
            RestoredSession { view: Arc::new(view), samples: goes_on.then_some(gathered) }
        };
        let sessions = views.into_iter().map(restored).collect();
        Restored { model_sets, active, sessions, next_session: newest.unwrap_or(0) + 1, ..Restored::default() }
    }
}
