//! The calibration of a patch, step by step: what commands, scans, pressure and fits do to its session.

use std::sync::Arc;
use std::time::Duration;

use crate::command::Rejection;
use crate::io::{Now, Output};
use crate::live::ScanEnd;
use crate::model_set::ModelSet;
use crate::patch::PatchEngine;
use crate::record::Record;
use crate::recording::FitRecipe;
use crate::rest::TaxelBaseline;
use crate::session::{FitJob, FitOutcome, Pending, Progress, SessionRun, SessionSamples, SessionState, SessionView};
use crate::tare::Purpose;

/// While a session is open its view is shown this often, besides at each change of state.
const SHOW_EVERY: Duration = Duration::from_millis(200);

impl PatchEngine {
    /// Begins a session; the caller has checked that none is open.
    pub(crate) fn start_session(&mut self, now: Now, view: SessionView, out: &mut Vec<Output>) {
        let taxels = self.plan.patch.taxels().len();
        self.session = Some(SessionRun::new(now, view, self.plan.session, taxels));
        self.tare_for_ramp(now, out);
    }

    /// Takes an interrupted session up again; another ramp or a fit can follow.
    pub(crate) fn resume_session(&mut self, now: Now, view: SessionView, samples: SessionSamples) {
        let taxels = self.plan.patch.taxels().len();
        self.session = Some(SessionRun::resume(now, view, self.plan.session, taxels, samples));
    }

    /// Another ramp: the bag must be vented, and rest is proven first.
    pub(crate) fn start_ramp(&mut self, now: Now, out: &mut Vec<Output>) -> Result<(), Rejection> {
        self.check_vented(now)?;
        self.tare_for_ramp(now, out);
        Ok(())
    }

    /// Refuses what needs a skin at rest while the bag presses on it.
    pub(crate) fn check_vented(&self, now: Now) -> Result<(), Rejection> {
        let limits = &self.plan.session;
        let Some((time, pressure)) = self.gauge.newest() else { return Ok(()) }; // the ramp itself waits for a gauge
        if now.time.since(time) > limits.gauge_timeout || pressure <= limits.vented_below {
            return Ok(());
        }
        let (kpa, limit) = (pressure.0, limits.vented_below.0);
        let why = format!("the bag is at {kpa:.1} kPa and presses on the skin: vent it below {limit:.1} kPa first");
        Err(Rejection::FailedPrecondition(why))
    }

    fn tare_for_ramp(&mut self, now: Now, out: &mut Vec<Output>) {
        let confirmed_by = self.session.as_ref().and_then(|s| s.view().confirmed_by.clone());
        self.enter(now, SessionState::Taring, "", out);
        self.watch(now, Purpose::Session { confirmed_by }, out);
    }

    /// Rest is proven: the ramp begins.
    pub(crate) fn session_zeroed(&mut self, now: Now, baseline: Vec<TaxelBaseline>, out: &mut Vec<Output>) {
        let Some(session) = &mut self.session else { return };
        if session.view().state != SessionState::Taring {
            return;
        }
        let ramp = session.begin_ramp(now, baseline);
        out.push(Output::Record(ramp));
        self.record_session(now, out);
    }

    /// Rest is not proven: keep watching until patience ends.
    pub(crate) fn session_restless(
        &mut self,
        now: Now,
        why: String,
        confirmed_by: Option<String>,
        out: &mut Vec<Output>,
    ) {
        let Some(session) = self.session.as_mut().filter(|s| s.view().state == SessionState::Taring) else { return };
        let waited_ns = now.wall_ns.saturating_sub(session.view().changed_wall_ns);
        if u128::try_from(waited_ns).unwrap_or(0) > self.plan.session.patience.as_nanos() {
            self.enter(now, SessionState::Failed, format!("rest was never proven: {why}"), out);
        } else {
            session.explain(format!("waiting for rest: {why}"));
            self.session_dirty = true;
            self.watch(now, Purpose::Session { confirmed_by }, out);
        }
    }

    /// A scan ended: it is offered to the ramp.
    pub(crate) fn offer_to_session(&mut self, now: Now, end: ScanEnd, out: &mut Vec<Output>) {
        let fresh_within = self.plan.period + self.plan.period / 2;
        let whole = end.whole && self.live.is_whole(fresh_within);
        let Some(session) = self.session.as_mut().filter(|s| s.view().state == SessionState::Ramping) else { return };
        let counts = || Arc::from(self.live.counts());
        session.on_scan(whole.then(|| Pending { time: end.time, counts: counts() }));
        self.session_dirty = true;
        self.advance_session(now, out);
    }

    /// Moves waiting scans on, as far as the pressure is known.
    pub(crate) fn advance_session(&mut self, now: Now, out: &mut Vec<Output>) {
        let Some(session) = &mut self.session else { return };
        if session.view().state == SessionState::Ramping && !self.tare.view().valid {
            // Counts of two zeros in one ramp would make a wrong model; what was gathered before is kept.
            let why = format!("the ramp's zero was lost: {}", self.tare.view().reason);
            return self.enter(now, SessionState::Failed, why, out);
        }
        let mut records = Vec::new();
        let progress = session.advance(now.time, &self.gauge, &mut records);
        out.extend(records.into_iter().map(Output::Record));
        match progress {
            Progress::On => {}
            Progress::Turned => self.record_session(now, out),
            Progress::RampEnded => self.fit_session(now, out),
            Progress::Failed => {
                let reason = session.view().reason.clone();
                self.enter(now, SessionState::Failed, reason, out);
            }
        }
    }

    /// Ends the rise of a session that gathers both branches, else the ramp.
    pub(crate) fn finish_ramp(&mut self, now: Now, out: &mut Vec<Output>) {
        if self.session.as_mut().is_some_and(|session| session.turn(now.time)) {
            self.record_session(now, out);
        } else {
            self.fit_session(now, out);
        }
    }

    /// Ends the ramp and hands the samples to the fit.
    fn fit_session(&mut self, now: Now, out: &mut Vec<Output>) {
        let Some(session) = &self.session else { return };
        let (view, plan) = (session.view(), &self.plan);
        let job = FitJob {
            session: view.number,
            patch: plan.patch.name().to_owned(),
            wall_ns: now.wall_ns,
            board_settings: self.board_settings(),
            samples: Arc::clone(session.samples()),
            modules: self.modules.clone(),
            recipe: FitRecipe {
                options: plan.fit,
                branch: view.branches,
                plays: plan.session.plays,
                faults: plan.faults,
                module_size: self.modules.first().map_or(1, ExactSizeIterator::len),
                ..FitRecipe::default()
            },
        };
        let ended_early = match view.state {
            SessionState::Ramping => view.reason.clone(),
            _ => String::new(),
        };
        self.enter(now, SessionState::Fitting, ended_early, out);
        out.push(Output::Fit(job));
    }

    /// The fit came back. Returns the new model set, if there is one.
    pub(crate) fn on_fitted(&mut self, now: Now, outcome: FitOutcome, out: &mut Vec<Output>) -> Option<Arc<ModelSet>> {
        let fitting =
            |s: &&mut SessionRun| s.view().number == outcome.session && s.view().state == SessionState::Fitting;
        let session = self.session.as_mut().filter(fitting)?; // aborted meanwhile: the samples are kept, the fit is not
        match outcome.result {
            Ok(set) => {
                session.set_model_set(Arc::from(set.id.as_str()));
                let ended_early = session.view().reason.clone();
                out.push(Output::Record(Record::ModelSet(Arc::clone(&set))));
                self.enter(now, SessionState::Review, ended_early, out);
                Some(set)
            }
            Err(reason) => {
                self.enter(now, SessionState::Failed, reason, out);
                None
            }
        }
    }

    /// Samples of a session are on disk, perhaps after it has ended.
    pub(crate) fn on_durable(&mut self, number: u64, samples: u64) {
        if let Some(session) = self.session.as_mut().filter(|s| s.view().number == number) {
            session.set_durable(samples);
            self.session_dirty = true;
        }
    }

    /// Changes the session's state, on disk and for readers.
    pub(crate) fn enter(&mut self, now: Now, state: SessionState, reason: impl Into<String>, out: &mut Vec<Output>) {
        let Some(session) = &mut self.session else { return };
        session.enter(now, state, reason);
        if state != SessionState::Taring && matches!(self.tare.watching(), Some(Purpose::Session { .. })) {
            self.tare.stop_watching();
        }
        self.record_session(now, out);
    }

    pub(crate) fn record_session(&mut self, now: Now, out: &mut Vec<Output>) {
        let Some(session) = &mut self.session else { return };
        session.refresh(now.time, &self.gauge);
        let view = Arc::new(session.view().clone());
        out.push(Output::Record(Record::Session(Arc::clone(&view))));
        out.push(Output::Session(self.index, view));
        self.session_dirty = false;
        self.session_shown = now.time;
    }

    /// Shows an open session's progress, a few times a second.
    pub(crate) fn show_session(&mut self, now: Now, out: &mut Vec<Output>) {
        let Some(session) = &mut self.session else { return };
        let due = now.time.since(self.session_shown) >= SHOW_EVERY;
        if due && (self.session_dirty || session.view().state.is_open()) {
            session.refresh(now.time, &self.gauge);
            out.push(Output::Session(self.index, Arc::new(session.view().clone())));
            self.session_dirty = false;
            self.session_shown = now.time;
        }
    }

    /// What the counts depend on, a line each board.
    fn board_settings(&self) -> Vec<String> {
        let listened = || self.plan.patch.boards().iter().map(|b| format!("board {}: settings unknown", b.address));
        if self.plan.bring_up.is_empty() {
            return listened().collect();
        }
        let boards = self.plan.patch.boards().iter().zip(&self.plan.bring_up);
        let line = |(board, setup): (&taxel_skin::Board, &crate::plan::BoardSetup)| {
            let b = setup.board;
            let triangles = setup
                .triangles
                .iter()
                .map(|t| format!("{}-{}: shift {} cdc_offset {:#06x}", t.first, t.last, t.shift, t.cdc_offset));
            let triangles = triangles.collect::<Vec<_>>().join(", ");
            format!(
                "board {}: type {} period {} ms no_load {}; {triangles}",
                board.address, b.kind, b.period_ms, b.no_load
            )
        };
        boards.map(line).collect()
    }
}
