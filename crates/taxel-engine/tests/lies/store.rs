//! The daemon's store as a simulation sees it: what has reached the disk, and what is on its way.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use taxel_engine::Restored;
use taxel_engine::calibration::{NotLoaded, SessionSamples, SessionState, SessionView};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::PatchPlan;
use taxel_engine::record::{KeptZero, Record};
use taxel_skin::Time;

/// Records on disk, and records that wait for it in order.
#[derive(Debug, Default)]
pub struct Store {
    model_sets: Vec<Arc<ModelSet>>,
    active: BTreeMap<String, String>,
    sessions: BTreeMap<u64, (Option<Arc<SessionView>>, SessionSamples)>,
    zeros: BTreeMap<String, KeptZero>,
    waiting: VecDeque<(Time, Record)>,
    /// It takes nothing any more.
    pub failed: bool,
    /// What was found of a board's zero did not reach the disk before the daemon stopped.
    forgotten: bool,
    /// The same, of the daemon that runs.
    unwritten: bool,
}

impl Store {
    /// A disk with one calibration of each patch in use, of boards that were configured as they are in the `plans`.
    pub fn with(sets: Vec<Arc<ModelSet>>, plans: &[PatchPlan]) -> Self {
        let active = sets.iter().map(|set| (set.patch.clone(), set.id.clone())).collect();
        let sessions = sets.iter().filter_map(|set| Some((set.session?, (None, SessionSamples::default()))));
        let sessions = sessions.collect();
        let zero = |plan: &PatchPlan| KeptZero { configured: Some(plan.settings_sum()), ..KeptZero::default() };
        let zeros = plans.iter().map(|plan| (plan.patch.name().to_owned(), zero(plan))).collect();
        Self { model_sets: sets, active, sessions, zeros, ..Self::default() }
    }

    /// Will be on disk at `due`, after all that came before; when that is, if the store takes it.
    pub fn take(&mut self, due: Time, record: Record) -> Option<Time> {
        if self.failed {
            self.unwritten |= finds_a_load(&record);
            return None;
        }
        let due = self.waiting.back().map_or(due, |(last, _)| due.max(*last));
        self.waiting.push_back((due, record));
        Some(due)
    }

    /// When a question that is asked at `due` is answered: after all that came before is on disk.
    pub fn answers_at(&self, due: Time) -> Time {
        self.waiting.back().map_or(due, |(last, _)| due.max(*last))
    }

    /// The model set of this id.
    pub fn set_of(&self, id: &str) -> Result<Arc<ModelSet>, NotLoaded> {
        let found = self.model_sets.iter().find(|set| set.id == id).cloned();
        found.ok_or_else(|| NotLoaded::Damaged("it is not there".to_owned()))
    }

    /// What a session gathered.
    pub fn samples_of(&self, session: u64) -> Result<SessionSamples, NotLoaded> {
        let found = self.sessions.get(&session).map(|(_, samples)| samples.clone());
        found.ok_or_else(|| NotLoaded::Damaged("they are not there".to_owned()))
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
            self.write_one(record);
        }
        written
    }

    fn write_one(&mut self, record: Record) {
        match record {
            Record::Session(view) => {
                let number = view.number;
                self.sessions.entry(number).or_default().0 = Some(view);
            }
            Record::Ramp { session, ramp } => self.sessions.entry(session).or_default().1.ramps.push(ramp),
            Record::Sample { session, sample, .. } => {
                self.sessions.entry(session).or_default().1.samples.push(sample);
            }
            Record::ModelSet(set) if self.model_sets.iter().any(|known| known.id == set.id) => {}
            Record::ModelSet(set) => self.model_sets.push(set),
            Record::Activated { patch, model_set, .. } => {
                self.active.insert(patch, model_set);
            }
            Record::ModelSetDeleted { model_set, .. } => self.model_sets.retain(|set| set.id != model_set),
            Record::SessionDeleted { session, .. } => drop(self.sessions.remove(&session)),
            Record::Zero { patch, zero, .. } => drop(self.zeros.insert(patch, zero)),
            Record::Load(_) | Record::Asked(_) | Record::Answered(_) | Record::Tared { .. } => {}
        }
    }

    /// The daemon stopped: what had not reached the disk is lost.
    pub fn lose_waiting(&mut self) {
        let doubts = self.waiting.iter().any(|(_, record)| finds_a_load(record));
        self.forgotten |= doubts || std::mem::take(&mut self.unwritten);
        self.waiting.clear();
    }

    /// Whether a daemon that ran before had found that a board's zero holds a load, and the disk did not get it.
    pub const fn has_forgotten(&self) -> bool {
        self.forgotten
    }

    /// What a start finds.
    pub fn restored(&self) -> Restored {
        let newest = self.sessions.keys().next_back().copied();
        let sessions = self.sessions.values().filter_map(|(view, _)| {
            let mut view = SessionView::clone(view.as_ref()?);
            if view.state.is_open() {
                view.state = SessionState::Interrupted;
            }
            Some(Arc::new(view))
        });
        Restored {
            model_sets: self.model_sets.iter().cloned().map(Into::into).collect(),
            active: self.active.clone().into_iter().collect(),
            sessions: sessions.collect(),
            next_session: newest.map_or(1, |number| number + 1),
            zeros: self.zeros.clone().into_iter().collect(),
            ..Restored::default()
        }
    }
}

/// Whether it was found that a board's zero may hold a load.
fn finds_a_load(record: &Record) -> bool {
    matches!(record, Record::Zero { zero, .. } if zero.unproven.is_some())
}
