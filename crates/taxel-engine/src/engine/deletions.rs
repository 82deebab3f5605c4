//! What an operator deletes: refused while anything uses it, gone once that is on disk.

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::calibration::transition::Trigger;
use crate::engine::answer::Answer;
use crate::engine::pending::{Effect, Forgotten};
use crate::engine::step::Engine;
use crate::known_set::KnownSet;
use crate::now::Now;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    pub(super) fn delete_model_set(
        &mut self,
        now: Now,
        request: RequestId,
        id: String,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        self.model_sets.get(&id).ok_or_else(|| Rejection::no_model_set(&id))?;
        self.refuse_if_set_is_deleted(&id)?;
        self.refuse_if_set_is_used(&id)?;
        if let Some(view) = self.session_of(&id).filter(|view| view.state.is_open()) {
            let (session, state) = (view.number, view.state.name());
            let why = format!("`{id}` is of session {session}, which is {state}; finish or abort that first");
            return Err(Rejection::FailedPrecondition(ErrorReason::SessionOpen, why));
        }
        let record = Record::ModelSetDeleted { model_set: id.clone(), wall_ns: now.wall_ns };
        self.commit(Effect::Forget { request, what: Forgotten::ModelSet(id) }, vec![record], out);
        Ok(Answer::Later)
    }

    pub(super) fn delete_session(
        &mut self,
        now: Now,
        request: RequestId,
        number: u64,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        let view = self.sessions.get(&number).ok_or_else(|| Rejection::no_session(number))?;
        self.refuse_if_session_ends(number)?;
        if view.state.is_open() {
            let why = format!("session {number} is {}; abort it first", view.state.name());
            return Err(Rejection::FailedPrecondition(ErrorReason::SessionOpen, why));
        }
        if let Some(id) = view.model_set.as_deref() {
            self.refuse_if_set_is_used(id)?;
        }
        let record = Record::SessionDeleted { session: number, wall_ns: now.wall_ns };
        self.commit(Effect::Forget { request, what: Forgotten::Session(number) }, vec![record], out);
        Ok(Answer::Later)
    }

    /// It is gone from the disk.
    pub(super) fn forget(&mut self, what: &Forgotten, out: &mut Vec<Output>) {
        match what {
            Forgotten::ModelSet(id) => self.model_sets.forget(id),
            Forgotten::Session(number) => {
                self.sessions.remove(number);
                if let Some(index) = self.held(*number) {
                    self.patches[index].forget_session();
                    out.push(Output::SessionGone(index));
                }
            }
        }
        self.catalogue_dirty = true;
    }

    /// Refuses what needs a model set that is on its way out.
    pub(super) fn refuse_if_set_is_deleted(&self, id: &str) -> Result<(), Rejection> {
        if self.pending.forgets(&Forgotten::ModelSet(id.to_owned())) {
            return Err(Rejection::FailedPrecondition(
                ErrorReason::BeingDeleted,
                format!("model set `{id}` is being deleted"),
            ));
        }
        Ok(())
    }

    /// Refuses what needs the samples of a session that is on its way out.
    pub(super) fn refuse_if_session_goes(&self, number: u64) -> Result<(), Rejection> {
        let goes = self.pending.forgets(&Forgotten::Session(number));
        if goes { Err(session_is_being(number, "deleted")) } else { Ok(()) }
    }

    /// Refuses what changes a session that is on its way out, or about to end.
    pub(super) fn refuse_if_session_ends(&self, number: u64) -> Result<(), Rejection> {
        self.refuse_if_session_goes(number)?;
        match self.pending.ends(number) {
            Some(Trigger::Discard) => Err(session_is_being(number, "discarded")),
            Some(_) => Err(session_is_being(number, "aborted")),
            None => Ok(()),
        }
    }

    /// Refuses what cannot be while a model set is in use or about to be.
    pub(super) fn refuse_if_set_is_used(&self, id: &str) -> Result<(), Rejection> {
        let uses = |patch: &&Patch| patch.models().is_some_and(|set| set.id == id);
        if let Some(patch) = self.patches.iter().find(uses) {
            let why = format!("model set `{id}` is in use on patch `{}`; activate another one first", patch.name());
            return Err(Rejection::FailedPrecondition(ErrorReason::ModelSetInUse, why));
        }
        let in_use = |set: &KnownSet| {
            let active = self.patches.iter().filter_map(Patch::models).any(|active| active.id == set.id);
            active || self.pending.activates_set(&set.id)
        };
        let comes_of_it = |set: &KnownSet| set.origins.iter().any(|origin| origin == id);
        if let Some(set) = self.model_sets.all().iter().find(|set| in_use(set) && comes_of_it(set)) {
            let why = format!("`{}`, which is in use, was made of model set `{id}` by known loads", set.id);
            return Err(Rejection::FailedPrecondition(ErrorReason::ModelSetInUse, why));
        }
        if self.pending.activates_set(id) {
            return Err(Rejection::FailedPrecondition(
                ErrorReason::ModelSetInUse,
                format!("model set `{id}` is being activated"),
            ));
        }
        Ok(())
    }
}

fn session_is_being(number: u64, what: &str) -> Rejection {
    Rejection::FailedPrecondition(ErrorReason::BeingDeleted, format!("session {number} is being {what}"))
}
