//! The model set of a fit of stored samples is kept, and is not in use by that.

use std::sync::Arc;

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::engine::answer::Answer;
use crate::engine::pending::Effect;
use crate::engine::step::Engine;
use crate::model_set::ModelSet;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    /// Much may have changed since the fit began, so everything is asked here.
    pub(super) fn keep_refit(
        &mut self,
        request: RequestId,
        set: Arc<ModelSet>,
        sessions: &[u64],
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        let index = self.patch_named(&set.patch)?;
        for number in sessions {
            self.refuse_if_session_goes(*number)?;
            let view = self.sessions.get(number).ok_or_else(|| Rejection::no_session(*number))?;
            if view.patch != set.patch {
                let why = format!("session {number} is of patch `{}`, the model set is of `{}`", view.patch, set.patch);
                return Err(Rejection::FailedPrecondition(ErrorReason::SessionsDiffer, why));
            }
        }
        let (given, taxels) = (set.taxels.len(), self.patches[index].taxels());
        if given != taxels {
            let why = format!("the model set has {given} taxels, patch `{}` has {taxels}", set.patch);
            return Err(Rejection::FailedPrecondition(ErrorReason::LayoutChanged, why));
        }
        self.refuse_if_set_is_deleted(&set.id)?;
        if self.model_sets.get(&set.id).is_none() {
            self.room_for_model_set()?;
        }
        // A set that is known already may still wait for the disk: it is written again, which the store finds done.
        let record = Record::ModelSet(Arc::clone(&set));
        self.commit(Effect::Refit { request, set }, vec![record], out);
        Ok(Answer::Later)
    }
}
