//! What takes effect once it is on disk.

use std::sync::Arc;

use crate::boundary::command::Done;
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::job::FitOutcome;
use crate::calibration::transition::{Trigger, transition};
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::pending::Effect;
use crate::engine::step::Engine;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    /// A fit came back. A model set is written down before the session says that it has one.
    pub(super) fn on_fitted(&mut self, now: Now, outcome: FitOutcome, out: &mut Vec<Output>) {
        // Aborted meanwhile: the samples are kept, the fit is not. Also asked again once the model set is on disk.
        let Some(patch) = self.patches.iter().position(|p| p.calibration().awaits(&outcome)) else { return };
        match &outcome.result {
            Ok(set) => {
                let record = Record::ModelSet(Arc::clone(set));
                self.commit(Effect::Fitted { patch, outcome }, vec![record], out);
            }
            Err(_) => self.end_fit(now, patch, &outcome, out),
        }
    }

    fn end_fit(&mut self, now: Now, patch: usize, outcome: &FitOutcome, out: &mut Vec<Output>) {
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
            Effect::Import { request, set } => {
                let id = set.id.clone();
                self.learn(set);
                out.push(Output::Reply(request, Ok(Done::Imported { model_set: id })));
            }
            Effect::Refit { request, set } => {
                let there = self.model_sets.get(&set.id).cloned();
                let (known, model_set) = (there.is_some(), there.unwrap_or_else(|| Arc::clone(&set).into()));
                self.learn(set);
                out.push(Output::Reply(request, Ok(Done::RefitKept { model_set, known })));
            }
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
            Effect::Fitted { patch, outcome } => {
                if let Ok(set) = &outcome.result {
                    self.learn(Arc::clone(set));
                }
                self.end_fit(now, patch, &outcome, out);
            }
        }
    }

    fn leave_undone(&mut self, now: Now, effect: Effect, why: &str, out: &mut Vec<Output>) {
        let why = format!("it could not be written to disk, and nothing has changed: {why}");
        let request = match effect {
            Effect::Activate { request, .. }
            | Effect::Import { request, .. }
            | Effect::Refit { request, .. }
            | Effect::Load { request, .. }
            | Effect::End { request, .. }
            | Effect::Forget { request, .. } => request,
            Effect::Zero { request, patch } => {
                self.patches[patch].reject_zero(request);
                request
            }
            Effect::Fitted { patch, outcome } => {
                let outcome = FitOutcome { result: Err(format!("the model set: {why}")), ..outcome };
                return self.end_fit(now, patch, &outcome, out);
            }
        };
        out.push(Output::Reply(request, Err(Rejection::Unavailable(ErrorReason::StoreUnavailable, why))));
    }

    fn learn(&mut self, set: Arc<ModelSet>) {
        let Self { model_sets, patches, .. } = self;
        model_sets.learn(set, |id| is_used(patches, id));
        self.catalogue_dirty = true;
    }

    /// A model set comes into use, and the sessions that the sets came from say so.
    fn put_to_use(&mut self, now: Now, request: RequestId, patch: usize, set: &Arc<ModelSet>, out: &mut Vec<Output>) {
        let before = self.patches[patch].models().cloned();
        self.with_patch(now, patch, out, |patch, _| patch.set_models(Arc::clone(set)));
        let Self { model_sets, patches, .. } = self;
        for set in [Some(set), before.as_ref()].into_iter().flatten() {
            model_sets.keep_at_hand(set, |id| is_used(patches, id));
        }
        let session = |set: &Arc<ModelSet>| self.session_of(&set.id).map(|view| view.number);
        let (old, new) = (before.as_ref().and_then(session), session(set));
        if let Some(number) = old.filter(|number| Some(*number) != new) {
            self.change_use(now, number, Trigger::TakenOutOfUse, "another model set is in use", out);
        }
        if let Some(number) = new {
            self.change_use(now, number, Trigger::TakenIntoUse, "", out);
        }
        self.catalogue_dirty = true;
        let previous = before.map(|set| set.id.clone());
        out.push(Output::Reply(request, Ok(Done::Activated { model_set: set.id.clone(), previous })));
    }

    /// What the sessions say of the models in use follows the models: the daemon may have ended when an activation was
    /// on disk and what the sessions say of it was not.
    pub(super) fn agree_on_use(&mut self, now: Now, out: &mut Vec<Output>) {
        let in_use = |view: &SessionView| {
            let set = self.patches.iter().find(|p| p.name() == view.patch).and_then(Patch::models);
            set.is_some_and(|set| view.model_set.as_deref() == Some(set.id.as_str()))
        };
        let differs = |view: &SessionView| match (view.state, in_use(view)) {
            (SessionState::Active, false) => Some((Trigger::TakenOutOfUse, "its model set is not in use")),
            (SessionState::Review, true) => Some((Trigger::TakenIntoUse, "")),
            _ => None,
        };
        let changes = self.sessions.values().filter_map(|view| Some((view.number, differs(view)?)));
        for (number, (trigger, reason)) in changes.collect::<Vec<_>>() {
            self.change_use(now, number, trigger, reason, out);
        }
    }

    /// A session's models came into use or went out of it.
    fn change_use(&mut self, now: Now, number: u64, trigger: Trigger, reason: &str, out: &mut Vec<Output>) {
        if let Some(index) = self.held(number) {
            return self.with_patch(now, index, out, |patch, effects| {
                patch.trigger_session(now, trigger, reason, effects);
            });
        }
        let view = self.sessions.get(&number);
        let Some((view, state)) = view.and_then(|view| Some((view, transition(view.state, trigger)?))) else { return };
        let mut view = SessionView::clone(view);
        (view.state, view.reason, view.changed_wall_ns) = (state, reason.to_owned(), now.wall_ns);
        out.push(Output::Record(Record::Session(Arc::new(view))));
    }
}

/// Whether a patch uses this model set.
fn is_used(patches: &[Patch], id: &str) -> bool {
    patches.iter().any(|patch| patch.models().is_some_and(|set| set.id == id))
}
