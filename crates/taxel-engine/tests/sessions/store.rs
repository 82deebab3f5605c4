//! What a store would have: records in order, of which a prefix is on disk.

use std::collections::BTreeMap;
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::calibration::{NotLoaded, SessionSamples, SessionState, SessionView};
use taxel_engine::known_set::{KnownSet, SetSummary};
use taxel_engine::model_set::ModelSet;
use taxel_engine::record::{KeptZero, Record};

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
        let mut model_sets: Vec<Arc<ModelSet>> = Vec::new();
        let mut active = Vec::new();
        for record in self.on_disk() {
            match record {
                Record::Session(view) => drop(views.insert(view.number, SessionView::clone(view))),
                Record::ModelSet(set) if model_sets.iter().any(|known| known.id == set.id) => {}
                Record::ModelSet(set) => model_sets.push(Arc::clone(set)),
                Record::Activated { model_set, .. } => active = vec![(PATCH.to_owned(), model_set.clone())],
                Record::ModelSetDeleted { .. } | Record::SessionDeleted { .. } => {
                    unreachable!("nothing is deleted here")
                }
                Record::Ramp { .. }
                | Record::Sample { .. }
                | Record::Load(_)
                | Record::Asked(_)
                | Record::Answered(_)
                | Record::Zero { .. } // which do not take part here
                | Record::Tared { .. } => {}
            }
        }
        let newest = views.keys().next_back().copied();
        let restored = |(number, mut view): (u64, SessionView)| {
            if view.state.is_open() {
                view.state = SessionState::Interrupted;
            }
            if view.state == SessionState::Interrupted {
                let gathered = self.gathered(number);
                view.ramps = gathered.ramps.len() as u16;
                view.accepted = gathered.samples.len() as u64;
                view.durable = view.accepted;
            }
            Arc::new(view)
        };
        let sessions = views.into_iter().map(restored).collect();
        // As the real store: in memory is what is in use.
        let known = |set: Arc<ModelSet>| match active.iter().any(|(_, id)| *id == set.id) {
            true => KnownSet::from(set),
            false => KnownSet::stored(SetSummary::of(&set)),
        };
        let model_sets = model_sets.into_iter().map(known).collect();
        let configured = Some(plan().patches[0].settings_sum());
        let zeros = vec![(PATCH.to_owned(), KeptZero { configured, ..KeptZero::default() })];
        Restored { model_sets, active, sessions, next_session: newest.unwrap_or(0) + 1, zeros, ..Restored::default() }
    }

    /// The model set of this id.
    pub fn set_of(&self, id: &str) -> Result<Arc<ModelSet>, NotLoaded> {
        let found = self.records.iter().find_map(|record| match record {
            Record::ModelSet(set) if set.id == id => Some(Arc::clone(set)),
            _ => None,
        });
        found.ok_or_else(|| NotLoaded::Damaged("it is not there".to_owned()))
    }

    /// The samples of a session.
    pub fn samples_of(&self, session: u64) -> Result<SessionSamples, NotLoaded> {
        Ok(self.gathered(session))
    }

    fn gathered(&self, number: u64) -> SessionSamples {
        let mut found = SessionSamples::default();
        for record in &self.records {
            match record {
                Record::Ramp { session, ramp } if *session == number => found.ramps.push(ramp.clone()),
                Record::Sample { session, index, sample } if *session == number => {
                    assert_eq!(found.samples.len() as u64, *index, "samples of session {session} have gaps");
                    found.samples.push(sample.clone());
                }
                _ => {}
            }
        }
        found
    }
}
