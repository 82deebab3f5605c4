//! The calibration of one patch: at most one session holds it at a time.
//!
//! Order of calls: a command, [`Calibration::on_scan`] for each scan, [`Calibration::advance`] whenever pressure or time
//! moved on, and what the zero says as it says it; after each [`Calibration::take_events`]: all that follows, in order.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::Time;

use crate::baseline::TaxelBaseline;
use crate::calibration::job::{FitJob, FitOutcome};
use crate::calibration::samples::{Pending, SessionSamples};
use crate::calibration::session::{Progress, SessionEvent, SessionRun};
use crate::calibration::transition::{Trigger, commanded, transition};
use crate::calibration::view::{SessionState, SessionView};
use crate::intake::gauge::GaugeHistory;
use crate::now::Now;
use crate::plan::PatchPlan;
use crate::request::{ErrorReason, Rejection};
use crate::scan::Scan;

/// While a session is open its view is shown this often, besides at each change of state.
const SHOW_EVERY: Duration = Duration::from_millis(200);

/// In review a pressure that moved by less is not shown anew: that is the gauge's noise.
const REVIEW_STEP_KPA: f64 = 0.5;

/// The calibration of one patch.
#[derive(Debug)]
pub struct Calibration {
    plan: Arc<PatchPlan>,
    session: Option<SessionRun>,
    /// How many fits were asked for: the number of the newest one.
    fits: u64,
    /// The view has changed since it was last shown.
    dirty: bool,
    shown: Time,
    events: Vec<SessionEvent>,
}

impl Calibration {
    /// No session.
    pub const fn new(plan: Arc<PatchPlan>) -> Self {
        Self { plan, session: None, fits: 0, dirty: false, shown: Time::from_nanos(i64::MIN), events: Vec::new() }
    }

    /// The session that holds the patch or was the last to.
    pub fn session(&self) -> Option<&SessionView> {
        self.session.as_ref().map(|session| &session.view)
    }

    /// The session that holds the patch now.
    pub fn open(&self) -> Option<&SessionView> {
        self.session().filter(|view| view.state.is_open())
    }

    /// Refuses what cannot be while a session holds the patch.
    ///
    /// # Errors
    /// [`Rejection::FailedPrecondition`] with the session, its state and what to do.
    pub fn refuse_if_open(&self, then: &str) -> Result<(), Rejection> {
        self.session().map_or(Ok(()), |session| session.check_closed(then))
    }

    /// Refuses a command that cannot be given to the session in its present state.
    ///
    /// # Errors
    /// [`Rejection`] if there is no session, or not in its present state.
    pub fn refuse_unless_possible(&self, command: Trigger) -> Result<(), Rejection> {
        let view = self.session().ok_or_else(no_session)?;
        commanded(view.number, view.state, command).map(|_| ())
    }

    /// Whether scans are offered to a ramp now.
    pub fn is_ramping(&self) -> bool {
        self.session().is_some_and(|view| view.state == SessionState::Ramping)
    }

    /// Whether a module was left out of the session by its operator.
    pub fn leaves_out(&self, module: usize) -> bool {
        self.session().is_some_and(|view| view.left_out.iter().any(|m| usize::from(*m) == module))
    }

    /// Begins a session. The caller has checked that none is open.
    pub fn start(&mut self, now: Now, view: SessionView) {
        self.session = Some(SessionRun::new(now, view, self.plan.session, self.plan.patch.taxels().len()));
        self.enter(now, SessionState::Taring, "");
        self.events.push(SessionEvent::WantsZero);
    }

    /// Takes up a session of an earlier run with the samples that were on disk.
    pub fn resume(&mut self, now: Now, view: SessionView, samples: SessionSamples) {
        let taxels = self.plan.patch.taxels().len();
        self.session = Some(SessionRun::resume(now, view, self.plan.session, taxels, samples));
    }

    /// The session was deleted. The caller has checked that it is not open.
    pub fn forget(&mut self) {
        (self.session, self.dirty) = (None, false);
    }

    /// What an operator asks of the session, and why.
    ///
    /// # Errors
    /// [`Rejection`] if there is no session, or not in its present state.
    pub fn command(&mut self, now: Now, command: Trigger, why: &str) -> Result<(), Rejection> {
        let session = self.session.as_mut().ok_or_else(no_session)?;
        let next = commanded(session.view.number, session.view.state, command)?;
        if matches!(command, Trigger::FinishRamp | Trigger::StartRamp) {
            session.view.check_trusted()?;
        }
        match command {
            Trigger::FinishRamp => {
                session.check_plateaus().map_err(|why| ErrorReason::SessionWrongState.because(why))?;
                if session.plateaus.is_some() {
                    session.view.reason.clear(); // what was to be done next
                    self.fit(now);
                } else if session.turn(now.time) {
                    self.events.push(SessionEvent::Changed);
                } else {
                    self.fit(now);
                }
            }
            Trigger::Discard | Trigger::Abort => self.enter(now, next, why),
            _ => {
                self.enter(now, next, "");
                self.events.push(SessionEvent::WantsZero);
            }
        }
        Ok(())
    }

    /// The operator types what the dial shows.
    ///
    /// # Errors
    /// [`Rejection`] if no ramp is under way, or why it is no plateau.
    pub fn take_plateau(&mut self, now: Now, kpa: f64) -> Result<(), Rejection> {
        let session = self.session.as_mut().filter(|session| session.view.state == SessionState::Ramping);
        let taken = match session {
            Some(session) => session.take_plateau(now.time, kpa, &mut self.events),
            None => Err("no ramp is under way: taxeld calibrate".to_owned()),
        };
        match taken.map_err(|why| ErrorReason::SessionWrongState.because(why))? {
            Progress::RampEnded => self.fit(now),
            _ => self.events.push(SessionEvent::Changed),
        }
        Ok(())
    }

    /// The zero that was wanted was taken: the ramp begins.
    pub fn on_zero_taken(&mut self, now: Now, baseline: Vec<TaxelBaseline>, gauge: &GaugeHistory) {
        let Some(session) = self.session.as_mut() else { return };
        if transition(session.view.state, Trigger::Zeroed).is_some() {
            self.events.extend([session.begin_ramp(now, baseline, gauge), SessionEvent::Changed]);
        }
    }

    /// The zero that the models of the session will refer to, as far as it has come.
    pub fn rest(&self) -> Option<&[TaxelBaseline]> {
        self.session.as_ref()?.samples.rest()
    }

    /// The zero that was wanted could not be taken: the session goes on watching until its patience ends.
    pub fn on_zero_refused(&mut self, now: Now, why: &str) {
        let Some(session) = self.session.as_mut() else { return };
        let Some(failed) = transition(session.view.state, Trigger::NeverAtRest) else { return };
        if now.time.since(session.entered) > self.plan.session.patience {
            self.enter(now, failed, format!("rest was never proven: {why}"));
        } else {
            session.view.reason = format!("waiting for an unloaded skin: {why}");
            self.dirty = true;
            self.events.push(SessionEvent::WantsZero);
        }
    }

    /// The zero was lost: counts of two zeros in one ramp would make a wrong model. What was gathered before is kept.
    pub fn on_zero_lost(&mut self, now: Now, why: &str) {
        if let Some(session) = self.session.as_mut() {
            session.drop_waiting();
            self.trigger(now, Trigger::ZeroLost, format!("the ramp's zero was lost: {why}"));
        }
    }

    /// The zero is in doubt: nothing enters until it holds again.
    pub fn on_zero_doubted(&mut self) {
        if let Some(session) = self.session.as_mut() {
            session.drop_waiting();
            self.dirty = true;
        }
    }

    /// A scan ended. `complete`: every module that the session needs is in it, and the zero holds.
    pub fn on_scan(&mut self, scan: &Scan<'_>, complete: bool) {
        let Some(session) = self.session.as_mut().filter(|s| s.view.state == SessionState::Ramping) else { return };
        session.on_scan(complete.then(|| Pending { time: scan.time, counts: scan.counts.into() }));
        self.dirty = true;
    }

    /// Moves waiting scans on, as far as pressure and time have come. `silence` says which modules are silent.
    pub fn advance(&mut self, now: Now, gauge: &GaugeHistory, silence: impl FnOnce() -> String) {
        let Some(session) = &mut self.session else { return };
        let progress = session.advance(now.time, gauge, &mut self.events);
        let mut reason = session.view.reason.clone();
        match progress {
            Progress::On => {}
            Progress::Turned => self.events.push(SessionEvent::Changed),
            Progress::RampEnded => self.fit(now),
            // The models of earlier ramps are good, and may be in use.
            Progress::Void if session.view.model_set.is_none() => self.trigger(now, Trigger::Void, reason),
            Progress::Void => self.trigger(now, Trigger::Hopeless, reason),
            Progress::Failed => {
                if session.stale_since_progress > 0 {
                    reason = format!("{reason}: {}; leave them out of the session or mend them", silence());
                }
                self.trigger(now, Trigger::Hopeless, reason);
            }
        }
    }

    /// Ends the ramp and hands the samples to the fit.
    fn fit(&mut self, now: Now) {
        let Some(session) = &self.session else { return };
        self.fits += 1;
        let view = &session.view;
        let job = FitJob {
            sessions: vec![view.number],
            fit: self.fits,
            wall_ns: now.wall_ns,
            board_settings: view.board_settings.to_vec(),
            left_out: view.left_out.clone(),
            ..FitJob::new(&self.plan, view.branches, Arc::clone(&session.samples))
        };
        let ended_early = match view.state {
            SessionState::Ramping => view.reason.clone(),
            _ => String::new(),
        };
        self.enter(now, SessionState::Fitting, ended_early);
        self.events.push(SessionEvent::Fit(Box::new(job)));
    }

    /// Whether the outcome of a fit is the one that this session waits for.
    pub fn awaits(&self, outcome: &FitOutcome) -> bool {
        let of_session =
            |view: &SessionView| view.number == outcome.session && transition(view.state, Trigger::Fitted).is_some();
        self.fits == outcome.fit && self.session().is_some_and(of_session)
    }

    /// A fit came back with a model set that is on disk, or why there is none. One that is not awaited changes nothing:
    /// its session was aborted meanwhile.
    pub fn on_fitted(&mut self, now: Now, outcome: &FitOutcome) {
        let awaited = self.awaits(outcome);
        let Some(session) = self.session.as_mut().filter(|_| awaited) else { return };
        match &outcome.result {
            Ok(set) => {
                session.view.model_set = Some(Arc::from(set.id.as_str()));
                let ended_early = session.view.reason.clone();
                self.trigger(now, Trigger::Fitted, ended_early);
            }
            Err(reason) => self.trigger(now, Trigger::FitFailed, reason.clone()),
        }
    }

    /// Samples of a session are on disk, perhaps after it has ended.
    pub fn on_durable(&mut self, number: u64, samples: u64) {
        if let Some(session) = self.session.as_mut().filter(|s| s.view.number == number) {
            session.view.durable = session.view.durable.max(samples);
            self.dirty = true;
        }
    }

    /// Something changes the session's state, if it can in its present one.
    pub fn trigger(&mut self, now: Now, trigger: Trigger, reason: impl Into<String>) {
        if let Some(next) = self.session().and_then(|view| transition(view.state, trigger)) {
            self.enter(now, next, reason);
        }
    }

    /// Changes the session's state, on disk and for readers.
    fn enter(&mut self, now: Now, state: SessionState, reason: impl Into<String>) {
        let Some(session) = &mut self.session else { return };
        if session.view.state == SessionState::Taring && state != SessionState::Taring {
            self.events.push(SessionEvent::ZeroNotWanted);
        }
        session.enter(now, state, reason);
        self.events.push(SessionEvent::Changed);
    }

    /// What followed of what has happened since this was asked last, in order.
    pub fn take_events(&mut self) -> Vec<SessionEvent> {
        std::mem::take(&mut self.events)
    }

    /// The session with pressure, rate, coverage and the time left as they are now.
    pub fn refreshed(&mut self, now: Time, gauge: &GaugeHistory) -> Option<Arc<SessionView>> {
        let session = self.session.as_mut()?;
        session.refresh(now, gauge);
        (self.dirty, self.shown) = (false, now);
        Some(Arc::new(session.view.clone()))
    }

    /// An open session's progress for readers, a few times a second. In review it goes on while the bag is being vented.
    pub fn show(&mut self, now: Time, gauge: &GaugeHistory) -> Option<Arc<SessionView>> {
        self.deadline().filter(|deadline| now >= *deadline)?;
        let idle = !self.dirty && self.open().is_none();
        let before = self.session()?.pressure_kpa;
        let view = self.refreshed(now, gauge)?;
        let moved = match (before, view.pressure_kpa) {
            (Some(before), Some(kpa)) => (before - kpa).abs() > REVIEW_STEP_KPA,
            (before, kpa) => before.is_some() != kpa.is_some(),
        };
        if idle && !moved {
            self.session.as_mut()?.view.pressure_kpa = before; // the next one is compared with what was shown
            return None;
        }
        Some(view)
    }

    /// When the progress is to be shown next; a session that holds its patch is looked at then, too.
    pub fn deadline(&self) -> Option<Time> {
        let reviewed = || self.session().is_some_and(|view| view.state == SessionState::Review);
        (self.dirty || self.open().is_some() || reviewed()).then(|| self.shown.max(Time::default()) + SHOW_EVERY)
    }
}

fn no_session() -> Rejection {
    Rejection::NotFound(ErrorReason::SessionUnknown, "session".to_owned())
}
