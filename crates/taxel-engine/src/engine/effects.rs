//! What takes effect once it is on disk.

use std::sync::Arc;

use crate::boundary::command::Done;
use crate::boundary::output::Output;
use crate::calibration::job::FitOutcome;
use crate::engine::pending::{Effect, Origin, ReadSet, TakeUp};
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
        let origin = Origin::Session { patch, outcome: outcome.clone() };
        if let Err(refusal) = self.keep(set, origin, out) {
            let outcome = FitOutcome { result: Err(format!("the model set: {refusal}")), ..outcome };
            self.end_fit(now, patch, &outcome, out);
        }
    }

    pub(super) fn end_fit(&mut self, now: Now, patch: usize, outcome: &FitOutcome, out: &mut Vec<Output>) {
        self.with_patch(now, patch, out, |patch, effects| patch.on_fitted(now, outcome, effects));
    }

    /// Records that were handed out under a ticket are on disk, or why not.
    pub(super) fn on_committed(&mut self, now: Now, ticket: u64, result: Result<(), String>, out: &mut Vec<Output>) {
        let Some(effect) = self.pending.take(ticket) else { return };
        match result {
            Ok(()) => self.take_effect(now, effect, out),
            Err(why) => self.leave_undone(now, effect, &why, out),
        }
    }

    fn take_effect(&mut self, now: Now, effect: Effect, out: &mut Vec<Output>) {
        match effect {
            Effect::Activate { request, patch, set } => self.put_to_use(now, request, patch, &set, out),
            Effect::Keep { set, origin } => self.on_kept(now, set, origin, out),
            Effect::TakeUp(_) | Effect::ReadSet(_) => {} // these wait to be read, not to be written
            Effect::Zero { request, patch } => {
                let adopted = self.with_patch(now, patch, out, |patch, _| patch.adopt_zero(now, request));
                let reply = adopted.map(Done::Tared);
                out.push(Output::Reply(request, reply));
            }
            Effect::Load { request, patch, load } => {
                self.patches[patch].keep_load(Arc::clone(&load));
                self.catalogue_dirty = true;
                out.push(Output::Reply(request, Ok(Done::LoadRecorded(load))));
            }
            Effect::Forget { request, what } => {
                self.forget(&what, out);
                out.push(Output::Reply(request, Ok(Done::Deleted)));
            }
            Effect::End { request, command, view } => {
                let reply = self.end_session(now, command, view, out);
                out.push(Output::Reply(request, reply));
            }
        }
    }

    fn leave_undone(&mut self, now: Now, effect: Effect, why: &str, out: &mut Vec<Output>) {
        let why = format!("it could not be written to disk, and nothing has changed: {why}");
        let request = match effect {
            Effect::Keep { origin: Origin::Session { patch, outcome }, .. } => {
                let outcome = FitOutcome { result: Err(format!("the model set: {why}")), ..outcome };
                return self.end_fit(now, patch, &outcome, out);
            }
            Effect::Zero { request, patch } => {
                self.patches[patch].reject_zero(request);
                request
            }
            Effect::Activate { request, .. }
            | Effect::Keep {
                origin: Origin::Import { request, .. } | Origin::Refit { request, .. } | Origin::Loads { request },
                ..
            }
            | Effect::Load { request, .. }
            | Effect::End { request, .. }
            | Effect::Forget { request, .. }
            | Effect::TakeUp(TakeUp { request, .. })
            | Effect::ReadSet(ReadSet { request, .. }) => request,
        };
        out.push(Output::Reply(request, Err(Rejection::Unavailable(ErrorReason::StoreUnavailable, why))));
    }
}
