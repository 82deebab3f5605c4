//! What the zero and the calibration say of each other's business goes through here, in one match each.

use std::sync::Arc;

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::job::FitOutcome;
use crate::calibration::samples::SessionSamples;
use crate::calibration::session::{SessionEvent, SessionRun};
use crate::calibration::view::SessionView;
use crate::force::reason::ReasonCode;
use crate::intake::boards::BoardNews;
use crate::intake::receive::Intake;
use crate::now::Now;
use crate::patch::owner::{Intent, Patch};
use crate::request::ErrorReason;
use crate::zero::events::ZeroEvent;
use crate::zero::holder::Zero;
use crate::zero::watch::Purpose;

impl Patch {
    /// Does something to the zero, and what follows from it.
    pub(super) fn with_zero(&mut self, now: Now, act: impl FnOnce(&mut Zero, &mut Vec<ZeroEvent>)) {
        let mut events = Vec::new();
        act(&mut self.zero, &mut events);
        self.on_zero_events(now, events);
    }

    /// Does something to the session that the patch holds, and what follows from it.
    pub fn with_session<T>(&mut self, now: Now, act: impl FnOnce(&mut SessionRun, &Intake) -> T) -> Option<T> {
        let result = act(self.session.as_mut()?, &self.intake);
        self.on_session_events(now);
        Some(result)
    }

    /// Whether the session that the patch holds waits for this outcome of a fit.
    pub fn awaits(&self, outcome: &FitOutcome) -> bool {
        self.session.as_ref().is_some_and(|session| session.awaits(outcome))
    }

    /// Begins a session; the caller has checked that none is open.
    pub fn start_session(&mut self, now: Now, view: SessionView) {
        self.session = Some(SessionRun::start(now, &self.plan, view));
        self.on_session_events(now);
    }

    /// Takes up a session of an earlier run with the samples that were on disk.
    pub fn resume_session(&mut self, now: Now, view: SessionView, samples: SessionSamples) {
        self.session = Some(SessionRun::resume(now, &self.plan, view, samples));
    }

    /// The session that the patch held last was deleted.
    pub fn forget_session(&mut self) {
        self.session = None;
    }

    /// What the zero says goes to all that depends on it.
    pub(super) fn on_zero_events(&mut self, now: Now, events: Vec<ZeroEvent>) {
        for event in events {
            self.dirty = true;
            match event {
                ZeroEvent::Proven { request, zero } => {
                    self.noted.zero = Some(zero);
                    let record = Record::Zero { patch: self.name().to_owned(), zero: self.noted.clone() };
                    self.intents.push(Intent::Zero { request, record });
                }
                ZeroEvent::Taken(purpose) => {
                    self.use_zero();
                    if let (Purpose::Session { .. }, Some(session)) = (purpose, &mut self.session) {
                        let baseline = self.zero.baseline().unwrap_or_default().to_vec();
                        session.on_zero_taken(now, baseline, self.intake.gauge());
                        session.samples.rest().into_iter().for_each(|rest| self.zero.note_session_rest(rest));
                    }
                }
                ZeroEvent::Refused(Purpose::AtStart, _, why) => {
                    // That a zero needs confirmation does not pass by itself.
                    let lasts = self.zero.needs_confirmation().is_some();
                    let lacks = self.force.models().is_some_and(|set| !set.knows_rest());
                    let hint = match lasts || lacks {
                        true => ". If the skin is unloaded: `taxeld tare --confirmed-by NAME`",
                        false => "",
                    };
                    self.zero.explain(ReasonCode::NotUnloaded, format!("no zero yet: {why}{hint}"));
                }
                ZeroEvent::Refused(Purpose::Operator { request, .. }, reason, why) => {
                    let lacks = self.force.lacks_models().filter(|_| reason == ErrorReason::TareUnproven);
                    let without = lacks.map(|lacks| (ErrorReason::NoModelSet, lacks.text().to_owned()));
                    let (reason, why) = without.unwrap_or((reason, why));
                    let why = format!("tare refused: {why}{}", remedy(reason));
                    self.out.push(Output::Reply(request, Err(reason.because(why))));
                }
                ZeroEvent::Refused(Purpose::Session { .. }, _, why) => {
                    self.session.iter_mut().for_each(|session| session.on_zero_refused(now, &why));
                }
                ZeroEvent::Lost(why) => {
                    self.force.set_zero(None, 0.0);
                    self.session.iter_mut().for_each(|session| session.on_zero_lost(now, &why));
                }
                ZeroEvent::BoardMoved { board, why } => {
                    self.intents.push(Intent::News { board, news: BoardNews::Moved(why) });
                }
                ZeroEvent::InCheck => {
                    self.force.move_zero(None, None, self.zero.residue_counts());
                    self.session.iter_mut().for_each(SessionRun::drop_waiting);
                }
                ZeroEvent::Moved | ZeroEvent::Cleared => {
                    self.force.move_zero(self.zero.in_force(), self.zero.as_taken(), self.zero.residue_counts());
                    self.zero.weigh(&self.force.newton_per_count());
                }
            }
            self.on_session_events(now);
        }
    }

    pub(super) fn use_zero(&mut self) {
        // A set that says nothing of the unloaded skin takes it from a zero that somebody confirmed.
        let completed = self.force.models().zip(self.zero.confirmed_now()).and_then(|(set, zero)| set.with_rest(zero));
        if let Some(set) = completed {
            self.set_models(Arc::new(set));
        }
        self.force.set_zero(self.zero.in_force(), self.zero.residue_counts());
        self.force.set_confirmed(self.zero.confirmed());
        self.zero.weigh(&self.force.newton_per_count());
        if let Some(baseline) = self.zero.baseline() {
            self.intake.expect_noise(baseline);
        }
    }

    pub(super) fn seen(&self, view: &Arc<SessionView>) -> Arc<SessionView> {
        view.seen(self.models().map(|set| set.id.as_str()))
    }

    /// The session that the patch holds or held last, as readers see it.
    pub fn seen_session(&self) -> Option<Arc<SessionView>> {
        self.session().map(|view| self.seen(&Arc::new(view.clone())))
    }

    /// What the session wants goes to the zero, to disk and to readers.
    fn on_session_events(&mut self, now: Now) {
        for event in self.session.as_mut().map(SessionRun::take_events).unwrap_or_default() {
            let Some(session) = &mut self.session else { return };
            let number = session.view.number;
            match event {
                SessionEvent::WantsZero => {
                    let confirmed_by = session.view.confirmed_by.clone();
                    self.with_zero(now, |zero, events| zero.watch(now.time, Purpose::Session { confirmed_by }, events));
                }
                SessionEvent::ZeroNotWanted => self.zero.end_watch_of_session(),
                SessionEvent::Ramp(ramp) => self.out.push(Output::Record(Record::Ramp { session: number, ramp })),
                SessionEvent::Sample { index, sample } => {
                    self.out.push(Output::Record(Record::Sample { session: number, index, sample }));
                }
                SessionEvent::Changed => {
                    let view = session.refreshed(now.time, self.intake.gauge());
                    self.out.push(Output::Record(Record::Session(Arc::clone(&view))));
                    self.out.push(Output::Session(self.index, self.seen(&view)));
                }
                SessionEvent::Fit(job) => self.out.push(Output::Fit(*job)),
            }
        }
    }
}

/// What an operator can do about a tare that was refused. Nobody's word counts for a skin that moved, or was not seen.
const fn remedy(refused: ErrorReason) -> &'static str {
    match refused {
        ErrorReason::TareLoaded | ErrorReason::TareUnproven => {
            ". Unload the skin and tare again. If it is unloaded: `taxeld tare --confirmed-by NAME`"
        }
        ErrorReason::TareUnsteady => ". Tare while nothing touches the skin and nothing moves it",
        _ => "",
    }
}
