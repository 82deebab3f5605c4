//! What a store has of the engine's records, and what a start finds in it.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::calibration::{NotLoaded, SessionSamples, SessionState};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::record::{KeptZero, Record};

/// Wall time at the origin of a run's clock: a label that nothing may depend on.
pub const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

#[derive(Clone, Debug, Default)]
pub struct Disk {
    /// All but the samples.
    pub restored: Restored,
    pub samples: BTreeMap<u64, SessionSamples>,
}

impl Disk {
    /// One calibration of each patch in use, of boards that were configured as they are in the `plans`.
    pub fn with(sets: Vec<Arc<ModelSet>>, plans: &[PatchPlan]) -> Self {
        let active = sets.iter().map(|set| (set.patch.clone(), set.id.clone())).collect();
        let samples = sets.iter().filter_map(|set| Some((set.session?, SessionSamples::default()))).collect();
        let zeros = plans.iter().map(|plan| (plan.patch.name().to_owned(), configured(plan))).collect();
        let model_sets = sets.into_iter().map(Into::into).collect();
        Self { restored: Restored { model_sets, active, zeros, ..Restored::default() }, samples }
    }

    pub fn of(records: &[Record]) -> Self {
        let mut disk = Self::default();
        records.iter().for_each(|record| disk.write(record.clone()));
        disk
    }

    pub fn write(&mut self, record: Record) {
        let Restored { model_sets, active, sessions, zeros, .. } = &mut self.restored;
        match record {
            Record::Session(view) => {
                self.samples.entry(view.number).or_default();
                match sessions.iter_mut().find(|known| known.number == view.number) {
                    Some(known) => *known = view,
                    None => sessions.push(view),
                }
            }
            Record::Ramp { session, ramp } => self.samples.entry(session).or_default().ramps.push(ramp),
            Record::Sample { session, index, sample } => {
                let samples = &mut self.samples.entry(session).or_default().samples;
                assert_eq!(samples.len() as u64, index, "samples of session {session} have gaps");
                samples.push(sample);
            }
            Record::ModelSet(set) => match model_sets.iter_mut().find(|known| known.id == set.id) {
                Some(known) => drop(known.at_hand.get_or_insert(set)),
                None => model_sets.push(set.into()),
            },
            Record::Activated { patch, model_set, .. } => replace(active, patch, model_set),
            Record::ModelSetDeleted { model_set } => model_sets.retain(|set| set.id != model_set),
            Record::SessionDeleted { session } => {
                self.samples.remove(&session);
                sessions.retain(|view| view.number != session);
            }
            Record::Zero { patch, zero } => replace(zeros, patch, zero),
            Record::Load(_) | Record::Asked(_) | Record::Answered(_) => {}
        }
    }

    /// What a start finds. All sets are in memory.
    pub fn found(&self) -> Restored {
        let mut found = self.restored.clone();
        for view in &mut found.sessions {
            if view.state.is_open() || view.state == SessionState::Interrupted {
                let gathered = self.samples.get(&view.number);
                let view = Arc::make_mut(view);
                view.state = SessionState::Interrupted;
                view.ramps = gathered.map_or(0, |of| of.ramps.len() as u16);
                view.accepted = gathered.map_or(0, |of| of.samples.len() as u64);
                view.durable = view.accepted;
            }
        }
        let newest = self.samples.keys().next_back().map_or(1, |number| number + 1);
        found.next_session = found.next_session.max(newest);
        found
    }

    /// The model set of this id.
    pub fn set_of(&self, id: &str) -> Result<Arc<ModelSet>, NotLoaded> {
        let found = self.restored.model_sets.iter().find(|set| set.id == id);
        let found = found.and_then(|known| known.at_hand.clone());
        found.ok_or_else(|| NotLoaded::Damaged("its hash is not that of its content".to_owned()))
    }

    /// What a session gathered.
    pub fn samples_of(&self, session: u64) -> Result<SessionSamples, NotLoaded> {
        let found = self.samples.get(&session).cloned();
        found.ok_or_else(|| NotLoaded::Damaged("they are not there".to_owned()))
    }
}

/// Of each patch there is one.
fn replace<T>(all: &mut Vec<(String, T)>, patch: String, of: T) {
    all.retain(|(known, _)| *known != patch);
    all.push((patch, of));
}

/// What a store has of boards that were configured so and of no zero.
pub fn configured(plan: &PatchPlan) -> KeptZero {
    KeptZero { configured: Some(plan.settings_sum()), ..KeptZero::default() }
}

/// The id of a set that a fit made.
pub fn id_of(set: &ModelSet) -> String {
    let mut hasher = DefaultHasher::new();
    format!("{:?}", set.taxels).hash(&mut hasher);
    format!("m-{:016x}", hasher.finish())
}
