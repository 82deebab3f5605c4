//! The model set that known loads made of another one is kept, and is not in use by that.

use std::sync::Arc;

use crate::boundary::output::Output;
use crate::boundary::record::Record;
use crate::engine::answer::Answer;
use crate::engine::pending::Effect;
use crate::engine::step::Engine;
use crate::known_set::SetSummary;
use crate::model_set::ModelSet;
use crate::request::{ErrorReason, Rejection, RequestId};

impl Engine {
    /// Something may have changed since the loads were looked at, so everything is asked here.
    pub(super) fn keep_recalibration(
        &mut self,
        request: RequestId,
        set: Arc<ModelSet>,
        out: &mut Vec<Output>,
    ) -> Result<Answer, Rejection> {
        self.store_takes_records()?;
        let index = self.patch_named(&set.patch)?;
        let refuse = |reason, why: String| Err(Rejection::FailedPrecondition(reason, why));
        let Some(recalibrated) = &set.recalibrated else {
            return refuse(ErrorReason::ProgramFault, format!("`{}` was not made by known loads", set.id));
        };
        let source = recalibrated.derived_from.as_str();
        // The loads were read with the active set; with another one they say nothing.
        let active = self.patches[index].models().map(|active| active.id.as_str());
        if active != Some(source) {
            let is = active.unwrap_or("none");
            return refuse(
                ErrorReason::ActiveSetChanged,
                format!("the loads were read with `{source}`, and {is} is active now: propose it again"),
            );
        }
        if self.comes_of_discarded(&SetSummary::of(&set)) {
            return refuse(
                ErrorReason::ModelSetDiscarded,
                format!("the session of `{source}` is DISCARDED: its models are not to be used"),
            );
        }
        let (given, taxels) = (set.taxels.len(), self.patches[index].taxels());
        if given != taxels {
            return refuse(
                ErrorReason::LayoutChanged,
                format!("the model set has {given} taxels, patch `{}` has {taxels}", set.patch),
            );
        }
        if let Some(why) = self.patches[index].unfit(&set) {
            return refuse(ErrorReason::LayoutChanged, why);
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
