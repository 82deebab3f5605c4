//! What takes effect once it is on disk.

use std::sync::Arc;

use crate::boundary::command::{Done, Reply};
use crate::boundary::output::Output;
use crate::calibration::job::FitOutcome;
use crate::engine::pending::{Effect, Origin};
use crate::engine::step::Engine;
use crate::now::Now;
use crate::request::{ErrorReason, Rejection};

impl Engine {
    /// A fit came back. A model set is written down before the session says that it has one.
    pub(super) fn on_fitted(&mut self, now: Now, outcome: FitOutcome, out: &mut Vec<Output>) {
        // Aborted meanwhile: the samples are kept, the fit is not. Also asked again once the model set is on disk.
        let Some(patch) = self.patches.iter().position(|p| p.calibration().awaits(&outcome)) else { return };
        let Ok(set) = &outcome.result else { return self.end_fit(now, patch, &outcome, out) };
        let set = Arc::clone(set);
        if let Err(refusal) = self.keep(None, set, Origin::Session(patch, outcome.clone()), out) {
            let outcome = FitOutcome { result: Err(format!("the model set: {refusal}")), ..outcome };
            self.end_fit(now, patch, &outcome, out);
        }
    }

    pub(super) fn end_fit(&mut self, now: Now, patch: usize, outcome: &FitOutcome, out: &mut Vec<Output>) {
        self.with_patch(now, patch, out, |patch, effects| {
            patch.with_session(now, effects, |calibration, intake, events| {
                calibration.on_fitted(now, outcome, intake.gauge(), events)
            });
        });
    }

    /// Records that were handed out under a ticket are on disk, or why not.
    pub(super) fn on_committed(&mut self, now: Now, ticket: u64, result: Result<(), String>, out: &mut Vec<Output>) {
        let Some((request, effect)) = self.pending.take(ticket) else { return };
        let reply = match result {
            Ok(()) => self.take_effect(now, effect, out),
            Err(why) => Err(self.leave_undone(now, effect, &why, out)),
        };
        out.extend(request.map(|request| Output::Reply(request, reply)));
    }

    fn take_effect(&mut self, now: Now, effect: Effect, out: &mut Vec<Output>) -> Reply {
        match effect {
            Effect::Activate(patch, set) => Ok(self.put_to_use(now, patch, &set, out)),
            Effect::Keep(set, origin) => Ok(self.on_kept(now, set, origin, out)),
            Effect::TakeUp(..) | Effect::ReadSet(_) => {
                let why = "what waits to be read was written, which is a fault of this program".to_owned();
                Err(ErrorReason::ProgramFault.because(why))
            }
            Effect::Zero(patch, request) => {
                self.with_patch(now, patch, out, |patch, _| patch.adopt_zero(request)).map(Done::Tared)
            }
            Effect::Load(patch, load) => {
                self.patches[patch].keep_load(Arc::clone(&load));
                self.catalogue_dirty = true;
                Ok(Done::LoadRecorded(load))
            }
            Effect::Forget(what) => {
                self.forget(&what, out);
                Ok(Done::Deleted)
            }
            Effect::End(command, view) => self.end_session(now, command, view, out),
        }
    }

    fn leave_undone(&mut self, now: Now, effect: Effect, why: &str, out: &mut Vec<Output>) -> Rejection {
        let why = format!("it could not be written to disk, and nothing has changed: {why}");
        match effect {
            Effect::Keep(_, Origin::Session(patch, outcome)) => {
                let outcome = FitOutcome { result: Err(format!("the model set: {why}")), ..outcome };
                self.end_fit(now, patch, &outcome, out);
            }
            Effect::Zero(patch, request) => self.patches[patch].reject_zero(request),
            _ => {}
        }
        Rejection::Unavailable(ErrorReason::StoreUnavailable, why)
    }
}
