//! One session: what is asked of it, what the zero and a fit say, and which state follows. What enters it is in `gather`.
//!
//! Order of calls: a command, [`SessionRun::on_scan`] for each scan, [`SessionRun::advance`] whenever pressure or time moved
//! on, and what the zero says as it says it; after each [`SessionRun::take_events`]: all that follows, in order.

mod gather;
mod shown;
#[cfg(test)]
pub mod tests;
mod typed;

use std::collections::VecDeque;
use std::sync::Arc;
use taxel_skin::{Kilopascal, Time};

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, Direction};
use crate::calibration::job::{FitJob, FitOutcome};
use crate::calibration::limits::SessionLimits;
use crate::calibration::plateau::Plateaus;
use crate::calibration::ramp::Ramp;
use crate::calibration::rise::Rise;
use crate::calibration::samples::{Pending, RampBaseline, Sample, SessionSamples};
use crate::calibration::transition::{Trigger, commanded, transition};
use crate::calibration::view::{SampleRefusal, SessionState, SessionView};
use crate::intake::gauge::{GaugeAtRest, GaugeHistory};
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::request::Rejection;

/// What follows of what happens to a session.
#[derive(Clone, Debug)]
pub enum SessionEvent {
    /// The skin is to be watched at rest, for the zero of a ramp.
    WantsZero,
    /// No zero is wanted any more.
    ZeroNotWanted,
    /// A ramp began at this zero: to disk.
    Ramp(RampBaseline),
    /// A scan entered: to disk.
    Sample {
        /// Position of the sample in the session, from 0.
        index: u64,
        /// The sample.
        sample: Sample,
    },
    /// It reached another state, or its view changed for good: to disk and to readers.
    Changed,
    /// This is to be computed outside the engine.
    Fit(Box<FitJob>),
}

/// The session that holds a patch, or was the last to.
#[derive(Debug)]
pub struct SessionRun {
    plan: Arc<PatchPlan>,
    pub(crate) view: SessionView,
    limits: SessionLimits,
    pub(crate) samples: Arc<SessionSamples>,
    ramp: Ramp,
    rise: Rise,
    /// Where a dial is typed: the plateaus of the present ramp.
    plateaus: Option<Plateaus>,
    pending: VecDeque<Pending>,
    /// One flag per 1 kPa step from 0 to the target.
    covered: Vec<bool>,
    /// Least and greatest count per taxel so far, in units.
    extremes: Vec<(f64, f64)>,
    /// Scans whose modules were not all fresh, since the last sample: they explain a failure.
    stale_since_progress: u64,
    /// Whether it was reported that the rise cannot get further.
    stalled: bool,
    /// When it reached its present state, on the run's clock.
    entered: Time,
    /// The view has changed since it was last shown, and when that was.
    dirty: bool,
    shown: Time,
    events: Vec<SessionEvent>,
}

impl SessionRun {
    /// Begins a session: the skin is watched at rest. The caller has checked that none is open.
    pub fn start(now: Now, plan: &Arc<PatchPlan>, view: SessionView) -> Self {
        let mut run = Self::resume(now, plan, view, SessionSamples::default());
        run.watch_rest(now);
        run
    }

    /// Takes up a session of an earlier run with the samples that were on disk.
    pub fn resume(now: Now, plan: &Arc<PatchPlan>, mut view: SessionView, samples: SessionSamples) -> Self {
        let taxels = plan.patch.taxels().len();
        view.accepted = samples.samples.len() as u64;
        view.durable = view.accepted;
        view.ramps = samples.ramps.len() as u16;
        view.responding = (0, taxels as u32);
        let mut run = Self {
            covered: vec![false; view.target_kpa.ceil().max(1.0) as usize],
            extremes: vec![(f64::INFINITY, f64::NEG_INFINITY); taxels],
            ramp: Ramp::new(now.time, view.direction, None),
            rise: Rise::default(),
            plateaus: plan.session.typed.then(|| Plateaus::begin(now.time)),
            limits: SessionLimits { target: Kilopascal(view.target_kpa), ..plan.session },
            view,
            samples: Arc::new(samples),
            pending: VecDeque::new(),
            stale_since_progress: 0,
            stalled: false,
            entered: now.time,
            dirty: false,
            shown: Time::default(),
            events: Vec::new(),
            plan: Arc::clone(plan),
        };
        let samples = Arc::clone(&run.samples);
        samples.pressures_kpa().into_iter().for_each(|kpa| run.cover(kpa));
        samples.samples.iter().for_each(|sample| run.note_extremes(sample.counts.counts()));
        run.count_responding();
        run
    }

    /// Whether scans are offered to a ramp now.
    pub fn is_ramping(&self) -> bool {
        self.view.state == SessionState::Ramping
    }

    /// Whether modules are left out of it while it holds its patch.
    pub fn leaves_out_any(&self) -> bool {
        self.view.state.is_open() && !self.view.left_out.is_empty()
    }

    /// What an operator asks of the session, and why.
    ///
    /// # Errors
    /// [`Rejection`] if it is not possible in its present state.
    pub fn command(&mut self, now: Now, command: Trigger, why: &str) -> Result<(), Rejection> {
        let next = commanded(self.view.number, self.view.state, command)?;
        match command {
            Trigger::FinishRamp => {
                self.view.check_trusted()?;
                self.check_plateaus()?;
                if self.plateaus.is_some() {
                    self.view.reason.clear(); // what was to be done next
                }
                if !self.turn(now.time) {
                    self.fit(now);
                }
            }
            Trigger::StartRamp => {
                self.view.check_trusted()?;
                self.watch_rest(now);
            }
            _ => self.enter(now, next, why),
        }
        Ok(())
    }

    fn watch_rest(&mut self, now: Now) {
        self.enter(now, SessionState::Taring, "");
        self.events.push(SessionEvent::WantsZero);
    }

    /// The zero that was wanted was taken: the ramp begins.
    pub fn on_zero_taken(&mut self, now: Now, taxels: Vec<TaxelBaseline>, gauge: &GaugeHistory) {
        if self.view.state != SessionState::Taring {
            return;
        }
        let (gauge_kpa, newest) = match gauge.at_rest(now.time, self.limits.gauge_rest()) {
            GaugeAtRest::Still { kpa, newest } => (Some(kpa.0), Some(newest)),
            GaugeAtRest::Moves(..) | GaugeAtRest::NotHeard => (None, None),
        };
        self.plateaus.iter_mut().for_each(|plateaus| *plateaus = Plateaus::begin(now.time));
        let ramp = RampBaseline { ramp: self.view.ramps, taxels, gauge_kpa };
        self.view.ramps += 1;
        self.begin_branch(Direction::Rising, Ramp::new(now.time, Direction::Rising, newest));
        Arc::make_mut(&mut self.samples).ramps.push(ramp.clone());
        self.events.push(SessionEvent::Ramp(ramp));
        self.enter(now, SessionState::Ramping, "");
    }

    /// The zero that was wanted could not be taken: the session goes on watching until its patience ends.
    pub fn on_zero_refused(&mut self, now: Now, why: &str) {
        if self.view.state != SessionState::Taring {
            return;
        }
        if now.time.since(self.entered) > self.limits.patience {
            self.enter(now, SessionState::Failed, format!("rest was never proven: {why}"));
        } else {
            self.view.reason = format!("waiting for an unloaded skin: {why}");
            self.dirty = true;
            self.events.push(SessionEvent::WantsZero);
        }
    }

    /// The zero was lost: counts of two zeros in one ramp would make a wrong model. What was gathered before is kept.
    pub fn on_zero_lost(&mut self, now: Now, why: &str) {
        self.drop_waiting();
        if self.is_ramping() {
            self.enter(now, SessionState::Failed, format!("the ramp's zero was lost: {why}"));
        }
    }

    /// The zero was lost or is in check: the scans that wait are not valid.
    pub fn drop_waiting(&mut self) {
        let dropped = self.pending.len() as u64;
        self.pending.clear();
        self.plateaus.iter_mut().for_each(Plateaus::forget_scans);
        self.view.refused.add(SampleRefusal::ZeroInCheck, dropped);
        self.dirty = true;
    }

    /// Ends the rise: the falling branch begins. False if the session gathers none, or it has begun.
    fn turn(&mut self, now: Time) -> bool {
        let rising = self.is_ramping() && self.view.direction == Direction::Rising;
        let turns = rising && self.view.branches == Branch::Both;
        if turns {
            self.begin_branch(Direction::Falling, self.ramp.turned(now, &self.limits));
            self.events.push(SessionEvent::Changed);
        }
        turns
    }

    fn begin_branch(&mut self, direction: Direction, branch: Ramp) {
        (self.view.direction, self.ramp) = (direction, branch);
        self.rise = Rise::default();
        (self.stale_since_progress, self.stalled) = (0, false);
    }

    /// Ends the ramp and hands the samples to the fit.
    fn fit(&mut self, now: Now) {
        let view = &self.view;
        let job = FitJob {
            sessions: vec![view.number],
            wall_ns: now.wall_ns,
            board_settings: view.board_settings.to_vec(),
            left_out: view.left_out.clone(),
            ..FitJob::new(&self.plan, view.branches, Arc::clone(&self.samples))
        };
        let ended_early = if self.is_ramping() { view.reason.clone() } else { String::new() };
        self.enter(now, SessionState::Fitting, ended_early);
        self.events.push(SessionEvent::Fit(Box::new(job)));
    }

    /// Whether the outcome of a fit is the one that this session waits for. It may have asked for another one since.
    pub fn awaits(&self, outcome: &FitOutcome) -> bool {
        let asked = (outcome.session, outcome.asked_wall_ns);
        self.view.state == SessionState::Fitting && (self.view.number, self.view.changed_wall_ns) == asked
    }

    /// A fit came back with a model set that is on disk, or why there is none. One that is not awaited changes nothing:
    /// its session was aborted meanwhile.
    pub fn on_fitted(&mut self, now: Now, outcome: &FitOutcome) {
        match &outcome.result {
            _ if !self.awaits(outcome) => {}
            Ok(set) => {
                self.view.model_set = Some(Arc::from(set.id.as_str()));
                self.trigger(now, Trigger::Fitted, self.view.reason.clone());
            }
            Err(reason) => self.trigger(now, Trigger::Fail, reason.clone()),
        }
    }

    /// Samples of a session are on disk, perhaps after it has ended.
    pub fn on_durable(&mut self, number: u64, samples: u64) {
        if self.view.number == number {
            self.view.durable = self.view.durable.max(samples);
            self.dirty = true;
        }
    }

    /// Something changes the session's state, if it can in its present one.
    pub fn trigger(&mut self, now: Now, trigger: Trigger, reason: impl Into<String>) {
        if let Some(next) = transition(self.view.state, trigger) {
            self.enter(now, next, reason);
        }
    }

    /// Changes the state, on disk and for readers; the reason is for people.
    fn enter(&mut self, now: Now, state: SessionState, reason: impl Into<String>) {
        if self.view.state == SessionState::Taring && !matches!(state, SessionState::Taring | SessionState::Ramping) {
            self.events.push(SessionEvent::ZeroNotWanted);
        }
        self.view.state = state;
        self.view.reason = reason.into();
        self.view.changed_wall_ns = now.wall_ns;
        self.view.remaining_s = None;
        self.entered = now.time;
        if state != SessionState::Ramping {
            self.pending.clear();
        }
        self.events.push(SessionEvent::Changed);
    }

    /// What followed of what has happened since this was asked last, in order.
    pub fn take_events(&mut self) -> Vec<SessionEvent> {
        std::mem::take(&mut self.events)
    }
}
