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
    pub(super) fn on_fitted(&mut self, now: Now, outcome: FitOutcome) {
        // Aborted meanwhile: the samples are kept, the fit is not. Also asked again once the model set is on disk.
        let Some(patch) = self.patches.iter().position(|p| p.awaits(&outcome)) else { return };
        let Ok(set) = &outcome.result else { return self.end_fit(now, patch, &outcome) };
        let set = Arc::clone(set);
        if let Err(refusal) = self.keep(None, set, Origin::Session(patch, outcome.clone())) {
            let outcome = FitOutcome { result: Err(format!("the model set: {refusal}")), ..outcome };
            self.end_fit(now, patch, &outcome);
        }
    }

    pub(super) fn end_fit(&mut self, now: Now, patch: usize, outcome: &FitOutcome) {
        self.with_patch(now, patch, |patch| {
            patch.with_session(now, |session, _| session.on_fitted(now, outcome));
        });
    }

    /// Records that were handed out under a ticket are on disk, or why not.
    pub(super) fn on_committed(&mut self, now: Now, ticket: u64, result: Result<(), String>) {
        let Some((request, effect)) = self.pending.take(ticket) else { return };
        let reply = match result {
            Ok(()) => self.take_effect(now, effect),
            Err(why) => Err(self.leave_undone(now, effect, &why)),
        };
        self.out.extend(request.map(|request| Output::Reply(request, reply)));
    }

    fn take_effect(&mut self, now: Now, effect: Effect) -> Reply {
        match effect {
            Effect::Activate(patch, set) => Ok(self.put_to_use(now, patch, &set)),
            Effect::Keep(set, origin) => Ok(self.on_kept(now, set, origin)),
            Effect::TakeUp(..) | Effect::ReadSet(_) => {
                let why = "what waits to be read was written, which is a fault of this program".to_owned();
                Err(ErrorReason::ProgramFault.because(why))
            }
            Effect::Zero(patch, request) => {
                self.with_patch(now, patch, |patch| patch.adopt_zero(request)).map(Done::Tared)
            }
            Effect::Load(patch, load) => {
                self.patches[patch].keep_load(Arc::clone(&load));
                self.catalogue_dirty = true;
                Ok(Done::LoadRecorded(load))
            }
            Effect::Forget(what) => {
                self.forget(&what);
                Ok(Done::Deleted)
            }
            Effect::End(command, view) => self.end_session(now, command, view),
        }
    }

    fn leave_undone(&mut self, now: Now, effect: Effect, why: &str) -> Rejection {
        let why = format!("it could not be written to disk, and nothing has changed: {why}");
        match effect {
            Effect::Keep(_, Origin::Session(patch, outcome)) => {
                let outcome = FitOutcome { result: Err(format!("the model set: {why}")), ..outcome };
                self.end_fit(now, patch, &outcome);
            }
            Effect::Zero(patch, request) => self.patches[patch].reject_zero(request),
            _ => {}
        }
        Rejection::Unavailable(ErrorReason::StoreUnavailable, why)
    }
}
