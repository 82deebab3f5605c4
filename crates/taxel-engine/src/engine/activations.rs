//! A model set comes into use: one that is not in memory is read first.

use std::sync::Arc;

use crate::boundary::catalogue::StoreDamage;
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::samples::NotLoaded;
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::answer::Answer;
use crate::engine::pending::{Effect, LoadingSet};
use crate::engine::step::Engine;
use crate::known_set::KnownSet;
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    /// Installs the model set that was active when the store was last written, unless it is of another skin than the one that
    /// is configured now.
    pub(super) fn install(&mut self, patch: &str, id: &str) {
        let known = self.model_sets.get(id).filter(|set| set.patch == patch);
        let discarded = known.is_some_and(|known| self.comes_of_discarded(known));
        let set = known.and_then(|known| known.at_hand.clone());
        let Some(found) = self.patches.iter_mut().find(|p| p.name() == patch) else {
            return; // the patch is not configured any more
        };
        let why = match set {
            None => format!("the active model set `{id}` of patch `{patch}` is lost"),
            Some(_) if discarded => {
                format!(
                    "model set `{id}` of patch `{patch}` is not used: its session was laid aside; activate another, or calibrate again"
                )
            }
            Some(set) if set.taxels.len() != found.taxels() => {
                format!("model set `{id}` is of another layout of patch `{patch}`: it is not used; calibrate again")
            }
            Some(set) => match found.unfit(&set) {
                Some(why) => format!("model set `{id}` of patch `{patch}` is not used: {why}"),
                None => return found.set_models(set),
            },
        };
        found.refuse_models(&why);
        self.problems.push(why);
    }

    pub(super) fn activate(
        &mut self,
        now: Now,
        request: RequestId,
        (patch, model_set, expected): (&str, String, Option<String>),
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        let patch = self.patch_named(patch)?;
        let loading = LoadingSet { request, patch, model_set, expected };
        match self.check_activation(&loading)?.at_hand {
            Some(set) => {
                self.check_fit(patch, &set)?;
                self.commit_activation(now, request, patch, set, out);
            }
            None => {
                let model_set = loading.model_set.clone();
                let ticket = self.pending.load_set(loading);
                out.push(Output::LoadSet { ticket, model_set });
            }
        }
        Ok(Answer::Later)
    }

    /// The set was read, or why not.
    pub(super) fn on_set_loaded(
        &mut self,
        now: Now,
        ticket: u64,
        result: Result<Arc<ModelSet>, NotLoaded>,
        out: &mut Vec<Output>,
    ) {
        let Some(loading) = self.pending.take_set(ticket) else { return };
        match self.loaded(&loading, result) {
            Ok(set) => self.commit_activation(now, loading.request, loading.patch, set, out),
            Err(rejection) => out.push(Output::Reply(loading.request, Err(rejection))),
        }
    }

    /// Everything may have changed while the set was read, so that everything is asked again.
    fn loaded(
        &self,
        loading: &LoadingSet,
        result: Result<Arc<ModelSet>, NotLoaded>,
    ) -> Result<Arc<ModelSet>, Rejection> {
        let id = &loading.model_set;
        let set = result.map_err(|why| match why {
            NotLoaded::Damaged(what) => Rejection::FailedPrecondition(ErrorReason::DataDamaged, format!(
                "model set `{id}` is damaged on disk and cannot be used: {what}; import it again, or activate another one"
            )),
            NotLoaded::Unavailable(why) => Rejection::Unavailable(ErrorReason::StoreUnavailable, why),
        })?;
        let known = self.check_activation(loading)?;
        if (&set.id, &set.patch, set.taxels.len()) != (&known.id, &known.patch, known.taxels) {
            let why = format!("the store gave another model set than `{id}`, which is a fault of this program");
            return Err(Rejection::FailedPrecondition(ErrorReason::ProgramFault, why));
        }
        self.check_fit(loading.patch, &set)?;
        Ok(set)
    }

    /// Refuses a set that was gathered with other settings of the boards, or corrected with other areas.
    fn check_fit(&self, patch: usize, set: &ModelSet) -> Result<(), Rejection> {
        self.patches[patch]
            .unfit(set)
            .map_or(Ok(()), |why| Err(Rejection::FailedPrecondition(ErrorReason::LayoutChanged, why)))
    }

    fn commit_activation(
        &mut self,
        now: Now,
        request: RequestId,
        patch: usize,
        set: Arc<ModelSet>,
        out: &mut Vec<Output>,
    ) {
        let name = self.patches[patch].name().to_owned();
        // The set goes along: the store finds it there, or writes it again if what it has is damaged.
        let stored = Record::ModelSet(Arc::clone(&set));
        let activated = Record::Activated { patch: name, model_set: set.id.clone(), wall_ns: now.wall_ns };
        self.commit(Effect::Activate { request, patch, set }, vec![stored, activated], out);
    }

    /// The set, if it may come into use on the patch now.
    fn check_activation(&self, asked: &LoadingSet) -> Result<KnownSet, Rejection> {
        let (index, id) = (asked.patch, asked.model_set.as_str());
        self.store_takes_records()?;
        let set = self.model_sets.get(id).ok_or_else(|| Rejection::no_model_set(id))?;
        self.refuse_if_set_is_deleted(id)?;
        let patch = &self.patches[index];
        let name = patch.name();
        if set.patch != name {
            let problem = format!("`{id}` is for patch `{}`, not for `{name}`", set.patch);
            return Err(Rejection::InvalidArgument { field: "model_set", problem });
        }
        let refuse = |reason, why: String| Err(Rejection::FailedPrecondition(reason, why));
        let (given, taxels) = (set.taxels, patch.taxels());
        if given != taxels {
            return refuse(
                ErrorReason::LayoutChanged,
                format!("`{id}` has {given} taxels, patch `{name}` has {taxels}: its layout has changed"),
            );
        }
        if self.pending.activates(index) {
            return refuse(
                ErrorReason::ActivationUnderWay,
                format!("another model set of patch `{name}` is being activated: ask again"),
            );
        }
        let is = patch.models().map_or("none", |set| set.id.as_str());
        let wrong = |expected: &&String| if expected.is_empty() { is != "none" } else { expected.as_str() != is };
        if let Some(expected) = asked.expected.as_ref().filter(wrong) {
            return refuse(
                ErrorReason::ActiveSetChanged,
                format!("expected `{expected}` to be active, but it is {is}"),
            );
        }
        if self.comes_of_discarded(set) {
            return refuse(
                ErrorReason::ModelSetDiscarded,
                format!("the session of `{id}` is DISCARDED: its models are not to be used"),
            );
        }
        Ok(set.clone())
    }

    /// The store found damage: what cannot be read any more is not offered any more. A set in use is whole in memory.
    pub(super) fn on_store_damaged(&mut self, now: Now, damage: StoreDamage) {
        self.damage = damage.problems;
        self.health_dirty.0 = true;
        for id in damage.model_sets {
            if self.refuse_if_set_is_used(&id).is_ok() {
                self.model_sets.forget(&id);
            }
        }
        for (number, why) in damage.sessions {
            let held = self.held(number).is_some();
            let Some(view) = self.sessions.get_mut(&number).filter(|view| !held && is_interrupted(view)) else {
                continue;
            };
            let reason = format!("its samples are damaged on disk: {why}");
            let state = SessionState::Failed;
            *view = Arc::new(SessionView { state, reason, changed_wall_ns: now.wall_ns, ..SessionView::clone(view) });
        }
        self.catalogue_dirty = true;
    }
}

fn is_interrupted(view: &SessionView) -> bool {
    view.state == SessionState::Interrupted
}
