//! The model sets of all patches: kept, brought into use, deleted.

use std::sync::Arc;

use crate::boundary::command::Done;
use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::samples::NotLoaded;
use crate::calibration::view::{SessionState, SessionView};
use crate::engine::pending::{Answer, Effect, Forgotten, Origin, ReadSet};
use crate::engine::plausible::implausible;
use crate::engine::step::Engine;
use crate::known_set::{KnownSet, SetSummary};
use crate::model_set::ModelSet;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    /// Installs the model set that was active when the store was last written, unless it is of another skin than the one that
    /// is configured now.
    pub(super) fn install(&mut self, patch: &str, id: &str) {
        let known = self.known_set(id).filter(|set| set.patch == patch);
        let discarded = known.is_some_and(|known| self.comes_of_discarded(known));
        let set = known.and_then(|known| known.at_hand.clone());
        let Some(found) = self.patches.iter_mut().find(|p| p.name() == patch) else {
            return; // the patch is not configured any more
        };
        let why = match set {
            None => format!("the active model set `{id}` of patch `{patch}` is lost"),
            Some(_) if discarded => {
                format!(
                    "model set `{id}` of patch `{patch}` is not used: its session was discarded; activate another, or calibrate again"
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

    /// The set of this id.
    pub(super) fn known_set(&self, id: &str) -> Option<&KnownSet> {
        self.model_sets.iter().find(|known| known.id == id)
    }

    /// In memory are the sets that are in use, and until another comes the one that came last: it is activated next.
    pub(super) fn keep_at_hand(&mut self) {
        for known in &mut self.model_sets {
            let used = self.patches.iter().filter_map(Patch::models).find(|set| set.id == known.id);
            known.at_hand = used.cloned();
        }
    }

    /// A set is kept and listed once it is on disk, and is not in use by that. Much may have changed since it was asked for or
    /// made, so everything is asked here. One that is known already may still wait for the disk: it is written again, which the
    /// store finds done.
    ///
    /// # Errors
    /// [`Rejection`] of a set that cannot be one of its patch, or is not of what is in use.
    pub(super) fn keep(&mut self, request: Option<RequestId>, set: Arc<ModelSet>, origin: Origin) -> Answer {
        let index = self.patch_named(&set.patch)?;
        match origin {
            Origin::Session(..) => self.store_takes_records()?,
            _ => self.check_changes(self.patches[index].name())?,
        }
        let (given, taxels) = (set.taxels.len(), self.patches[index].taxels());
        if given != taxels {
            let why = format!("the model set has {given} taxels, patch `{}` has {taxels}", set.patch);
            return Err(match origin {
                Origin::Import { .. } => Rejection::invalid("json", why),
                _ => ErrorReason::LayoutChanged.because(why),
            });
        }
        match &origin {
            Origin::Import { insist } => self.check_plausible(index, &set, *insist)?,
            Origin::Refit(sessions) => self.check_sessions(&set, sessions)?,
            Origin::Loads => self.check_source(index, &set)?,
            Origin::Session(..) => {}
        }
        let record = Record::ModelSet(Arc::clone(&set));
        self.commit(request, Effect::Keep(set, origin), vec![record]);
        Ok(None)
    }

    fn check_plausible(&self, index: usize, set: &ModelSet, insist: bool) -> Result<(), Rejection> {
        let plan = self.patches[index].plan();
        match implausible(set, plan.session.target, plan.patch.counts().top()).filter(|_| !insist) {
            None => Ok(()),
            Some(problem) => {
                Err(Rejection::invalid("json", format!("{problem}; if the set is right all the same, set `insist`")))
            }
        }
    }

    /// Refuses what was fitted to samples of sessions that are not there any more, or of another patch.
    fn check_sessions(&self, set: &ModelSet, sessions: &[u64]) -> Result<(), Rejection> {
        for number in sessions {
            let view = self.sessions.get(number).ok_or_else(|| Rejection::no_session(*number))?;
            ErrorReason::SessionsDiffer.unless(view.patch == set.patch, || {
                format!("session {number} is of patch `{}`, the model set is of `{}`", view.patch, set.patch)
            })?;
        }
        Ok(())
    }

    /// Refuses what known loads made of another set than the active one, with which they were read.
    fn check_source(&self, index: usize, set: &ModelSet) -> Result<(), Rejection> {
        let Some(recalibrated) = &set.recalibrated else {
            return Err(ErrorReason::ProgramFault.because(format!("`{}` was not made by known loads", set.id)));
        };
        let source = recalibrated.derived_from.as_str();
        let active = self.patches[index].models().map(|active| active.id.as_str());
        ErrorReason::ActiveSetChanged.unless(active == Some(source), || {
            let is = active.unwrap_or("none");
            format!("the loads were read with `{source}`, and {is} is active now: propose it again")
        })?;
        self.refuse_if_discarded(&SetSummary::of(set), source)?;
        self.check_fit(index, set)
    }

    /// A set is on disk.
    pub(super) fn on_kept(&mut self, now: Now, set: Arc<ModelSet>, origin: Origin) -> Done {
        let known = self.known_set(&set.id).cloned();
        let was_known = known.is_some();
        let model_set = known.unwrap_or_else(|| set.into());
        if !was_known {
            self.keep_at_hand();
            self.model_sets.push(model_set.clone());
            self.catalogue_dirty = true;
        }
        if let Origin::Session(patch, outcome) = origin {
            self.end_fit(now, patch, &outcome);
        }
        Done::Kept { model_set, known: was_known }
    }

    pub(super) fn activate(
        &mut self,
        now: Now,
        request: RequestId,
        (patch, model_set, expected): (&str, String, Option<String>),
    ) -> Answer {
        let patch = self.patch_named(patch)?;
        let loading = ReadSet { patch, model_set, expected };
        match self.check_activation(&loading)?.at_hand {
            Some(set) => {
                self.check_fit(patch, &set)?;
                self.commit_activation(now, Some(request), patch, set);
            }
            None => {
                let model_set = loading.model_set.clone();
                let ticket = self.pending.keep(Some(request), Effect::ReadSet(loading));
                self.out.push(Output::LoadSet { ticket, model_set });
            }
        }
        Ok(None)
    }

    /// The set was read, or why not.
    pub(super) fn on_set_loaded(&mut self, now: Now, ticket: u64, result: Result<Arc<ModelSet>, NotLoaded>) {
        let Some((request, Effect::ReadSet(loading))) = self.pending.take(ticket) else { return };
        match self.loaded(&loading, result) {
            Ok(set) => self.commit_activation(now, request, loading.patch, set),
            Err(rejection) => self.out.extend(request.map(|request| Output::Reply(request, Err(rejection)))),
        }
    }

    /// Everything may have changed while the set was read, so that everything is asked again.
    fn loaded(&self, loading: &ReadSet, result: Result<Arc<ModelSet>, NotLoaded>) -> Result<Arc<ModelSet>, Rejection> {
        let id = &loading.model_set;
        let damaged = |what| {
            format!(
                "model set `{id}` is damaged on disk and cannot be used: {what}; import it again, or activate another one"
            )
        };
        let set = result.map_err(|why| why.refusal(damaged))?;
        let known = self.check_activation(loading)?;
        if (&set.id, &set.patch, set.taxels.len()) != (&known.id, &known.patch, known.taxels) {
            let why = format!("the store gave another model set than `{id}`, which is a fault of this program");
            return Err(ErrorReason::ProgramFault.because(why));
        }
        self.check_fit(loading.patch, &set)?;
        Ok(set)
    }

    /// Refuses a set that was gathered with other settings of the boards, or corrected with other areas.
    fn check_fit(&self, patch: usize, set: &ModelSet) -> Result<(), Rejection> {
        self.patches[patch].unfit(set).map_or(Ok(()), |why| Err(ErrorReason::LayoutChanged.because(why)))
    }

    fn commit_activation(&mut self, now: Now, request: Option<RequestId>, patch: usize, set: Arc<ModelSet>) {
        let name = self.patches[patch].name().to_owned();
        // The set goes along: the store finds it there, or writes it again if what it has is damaged.
        let stored = Record::ModelSet(Arc::clone(&set));
        let activated = Record::Activated { patch: name, model_set: set.id.clone(), wall_ns: now.wall_ns };
        self.commit(request, Effect::Activate(patch, set), vec![stored, activated]);
    }

    /// The set, if it may come into use on the patch now.
    fn check_activation(&self, asked: &ReadSet) -> Result<KnownSet, Rejection> {
        let (index, id) = (asked.patch, asked.model_set.as_str());
        let set = self.known_set(id).ok_or_else(|| Rejection::no_model_set(id))?;
        let patch = &self.patches[index];
        self.check_changes(patch.name())?;
        let name = patch.name();
        if set.patch != name {
            return Err(Rejection::invalid(
                "model_set",
                format!("`{id}` is for patch `{}`, not for `{name}`", set.patch),
            ));
        }
        let (given, taxels) = (set.taxels, patch.taxels());
        ErrorReason::LayoutChanged.unless(given == taxels, || {
            format!("`{id}` has {given} taxels, patch `{name}` has {taxels}: its layout has changed")
        })?;
        let is = patch.models().map_or("none", |set| set.id.as_str());
        if let Some(expected) = &asked.expected {
            let as_expected = if expected.is_empty() { is == "none" } else { expected == is };
            ErrorReason::ActiveSetChanged
                .unless(as_expected, || format!("expected `{expected}` to be active, but it is {is}"))?;
        }
        self.refuse_if_discarded(set, id)?;
        Ok(set.clone())
    }

    /// A model set comes into use, and readers see the session that it came from in use.
    pub(super) fn put_to_use(&mut self, now: Now, patch: usize, set: &Arc<ModelSet>) -> Done {
        let before = self.patches[patch].models().cloned();
        self.with_patch(now, patch, |patch| patch.set_models(Arc::clone(set)));
        self.keep_at_hand();
        if let Some(view) = self.patches[patch].seen_session() {
            self.out.push(Output::Session(patch, view));
        }
        self.catalogue_dirty = true;
        Done::Activated { model_set: set.id.clone(), previous: before.map(|set| set.id.clone()) }
    }

    pub(super) fn delete_model_set(&mut self, request: RequestId, id: String) -> Answer {
        let known = self.known_set(&id).ok_or_else(|| Rejection::no_model_set(&id))?;
        self.check_changes(&known.patch)?;
        self.refuse_if_set_is_used(&id)?;
        if let Some(view) = self.session_of(&id).filter(|view| view.state.is_open()) {
            let (session, state) = (view.number, view.state.name());
            let why = format!("`{id}` is of session {session}, which is {state}; finish or abort that first");
            return Err(ErrorReason::SessionOpen.because(why));
        }
        let record = Record::ModelSetDeleted { model_set: id.clone() };
        self.commit(Some(request), Effect::Forget(Forgotten::ModelSet(id)), vec![record]);
        Ok(None)
    }

    /// Refuses what cannot be while a model set is in use.
    pub(super) fn refuse_if_set_is_used(&self, id: &str) -> Result<(), Rejection> {
        let uses = |patch: &&Patch| patch.models().is_some_and(|set| set.id == id);
        if let Some(patch) = self.patches.iter().find(uses) {
            let why = format!("model set `{id}` is in use on patch `{}`; activate another one first", patch.name());
            return Err(ErrorReason::ModelSetInUse.because(why));
        }
        let in_use = |set: &KnownSet| self.patches.iter().filter_map(Patch::models).any(|active| active.id == set.id);
        let comes_of_it = |set: &KnownSet| set.origins.iter().any(|origin| origin == id);
        if let Some(set) = self.model_sets.iter().find(|set| in_use(set) && comes_of_it(set)) {
            let why = format!("`{}`, which is in use, was made of model set `{id}` by known loads", set.id);
            return Err(ErrorReason::ModelSetInUse.because(why));
        }
        Ok(())
    }

    /// The session of this daemon that a set came from, which names the set. It may have come back from a file since, which
    /// proves no number of a session.
    pub(super) fn session_of(&self, set: &str) -> Option<&Arc<SessionView>> {
        self.sessions.values().rev().find(|view| view.model_set.as_deref() == Some(set))
    }

    /// A session as readers see it.
    pub(super) fn seen(&self, view: &Arc<SessionView>) -> Arc<SessionView> {
        let patch = self.patches.iter().find(|patch| patch.name() == view.patch);
        view.seen(patch.and_then(Patch::models).map(|set| set.id.as_str()))
    }

    /// Whether a set, or one that it was made of by known loads, is that of a session which was laid aside.
    pub(super) fn comes_of_discarded(&self, set: &SetSummary) -> bool {
        let discarded = |id: &str| {
            let of = |view: &Arc<SessionView>| view.model_set.as_deref() == Some(id);
            self.sessions.values().any(|view| of(view) && view.state == SessionState::Discarded)
        };
        discarded(&set.id) || set.origins.iter().any(|origin| discarded(origin))
    }

    /// Refuses a set that comes of a session which was laid aside.
    fn refuse_if_discarded(&self, set: &SetSummary, named: &str) -> Result<(), Rejection> {
        ErrorReason::ModelSetDiscarded.unless(!self.comes_of_discarded(set), || {
            format!("the session of `{named}` is DISCARDED: its models are not to be used")
        })
    }
}
