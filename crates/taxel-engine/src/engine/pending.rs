//! What waits to be on disk before it takes effect: what is acknowledged is durable, what is refused has no effect.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::boundary::command::Done;
use crate::calibration::job::FitOutcome;
use crate::calibration::transition::Trigger;
use crate::calibration::view::SessionView;
use crate::loads::load::Load;
use crate::model_set::ModelSet;
use crate::request::{Rejection, RequestId};

/// What a command did; `None` if its effect answers it later, when it is on disk or read from there.
pub(super) type Answer = Result<Option<Done>, Rejection>;

/// The effect that something will have.
#[derive(Clone, Debug)]
pub enum Effect {
    /// A model set comes into use on the patch at this position.
    Activate(usize, Arc<ModelSet>),
    /// A model set is kept.
    Keep(Arc<ModelSet>, Origin),
    /// The zero of the patch at this position holds that was proven for this request.
    Zero(usize, RequestId),
    /// A known load on the patch at this position counts.
    Load(usize, Arc<Load>),
    /// Something is not known any more.
    Forget(Forgotten),
    /// An operator ends a session that gathers nothing: how, and what is known of it then.
    End(Trigger, Arc<SessionView>),
    /// A command to the session of this number goes on when its samples are read.
    TakeUp(u64, Trigger),
    /// An activation goes on when its set is read.
    ReadSet(ReadSet),
}

/// Where a model set comes from that is kept.
#[derive(Clone, Debug)]
pub enum Origin {
    /// A file that somebody imports.
    Import {
        /// Somebody insists that it is right, whatever is odd about it.
        insist: bool,
    },
    /// A fit of the stored samples of these sessions.
    Refit(Vec<u64>),
    /// Known loads, which corrected the active set.
    Loads,
    /// The fit that ends the session of the patch at this position, and what it came to.
    Session(usize, FitOutcome),
}

/// What is deleted.
#[derive(Clone, Debug)]
pub enum Forgotten {
    /// The model set of this id.
    ModelSet(String),
    /// The session of this number.
    Session(u64),
}

/// A command to use a model set that is being read.
#[derive(Clone, Debug)]
pub struct ReadSet {
    /// Position of the patch.
    pub patch: usize,
    /// The set's id.
    pub model_set: String,
    /// The set that has to be active now, if one was named.
    pub expected: Option<String>,
}

/// What waits for the disk, by the ticket under which the shell writes or reads.
#[derive(Debug, Default)]
pub struct Pending {
    next: u64,
    /// Each with whom to answer; a session that ends with its fit asks for nothing.
    effects: BTreeMap<u64, (Option<RequestId>, Effect)>,
}

impl Pending {
    /// Keeps an effect; its ticket.
    pub fn keep(&mut self, request: Option<RequestId>, effect: Effect) -> u64 {
        self.next += 1;
        self.effects.insert(self.next, (request, effect));
        self.next
    }

    /// The effect of a ticket and whom to answer, once.
    pub fn take(&mut self, ticket: u64) -> Option<(Option<RequestId>, Effect)> {
        self.effects.remove(&ticket)
    }

    /// What waits for the disk and other changes of sessions and sets may contradict: what is activated, deleted or ended.
    pub fn changes(&self) -> impl Iterator<Item = &Effect> {
        let effects = self.effects.values().map(|(_, effect)| effect);
        effects.filter(|effect| matches!(effect, Effect::Activate(..) | Effect::Forget(_) | Effect::End(..)))
    }
}
