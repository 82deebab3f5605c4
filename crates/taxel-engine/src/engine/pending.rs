//! What waits to be on disk before it takes effect: what is acknowledged is durable, what is refused has no effect.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::boundary::command::Done;
use crate::calibration::job::FitOutcome;
use crate::calibration::transition::Trigger;
use crate::calibration::view::SessionView;
use crate::loads::load::Load;
use crate::model_set::ModelSet;
use crate::request::RequestId;

/// A command is answered at once, or its effect answers it later.
pub(super) enum Answer {
    /// With this.
    Now(Done),
    /// When it is on disk, or read from there.
    Later,
}

/// The effect that something will have.
#[derive(Clone, Debug)]
pub enum Effect {
    /// A model set comes into use.
    Activate {
        /// Whom to answer.
        request: RequestId,
        /// Position of the patch.
        patch: usize,
        /// The set.
        set: Arc<ModelSet>,
    },
    /// A model set is kept.
    Keep {
        /// The set.
        set: Arc<ModelSet>,
        /// Where it comes from.
        origin: Origin,
    },
    /// A zero holds.
    Zero {
        /// Whom to answer.
        request: RequestId,
        /// Position of the patch.
        patch: usize,
    },
    /// A known load counts.
    Load {
        /// Whom to answer.
        request: RequestId,
        /// Position of the patch.
        patch: usize,
        /// The load.
        load: Arc<Load>,
    },
    /// Something is not known any more.
    Forget {
        /// Whom to answer.
        request: RequestId,
        /// What it is.
        what: Forgotten,
    },
    /// An operator ends a session that gathers nothing.
    End {
        /// Whom to answer.
        request: RequestId,
        /// How it was ended.
        command: Trigger,
        /// What is known of it then.
        view: Arc<SessionView>,
    },
    /// A command to a session goes on when its samples are read.
    TakeUp(TakeUp),
    /// An activation goes on when its set is read.
    ReadSet(ReadSet),
}

/// Where a model set comes from that is kept.
#[derive(Clone, Debug)]
pub enum Origin {
    /// A file that somebody imports.
    Import {
        /// Whom to answer.
        request: RequestId,
        /// Somebody insists that it is right, whatever is odd about it.
        insist: bool,
    },
    /// A fit of stored samples.
    Refit {
        /// Whom to answer.
        request: RequestId,
        /// Whose samples.
        sessions: Vec<u64>,
    },
    /// Known loads, which corrected the active set.
    Loads {
        /// Whom to answer.
        request: RequestId,
    },
    /// The fit that ends a session.
    Session {
        /// Position of the patch.
        patch: usize,
        /// What it came to.
        outcome: FitOutcome,
    },
}

/// What is deleted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Forgotten {
    /// The model set of this id.
    ModelSet(String),
    /// The session of this number.
    Session(u64),
}

/// A command to a session whose samples are being read.
#[derive(Clone, Copy, Debug)]
pub struct TakeUp {
    /// Whom to answer.
    pub request: RequestId,
    /// Number of the session.
    pub session: u64,
    /// What is asked of it.
    pub command: Trigger,
}

/// A command to use a model set that is being read.
#[derive(Clone, Debug)]
pub struct ReadSet {
    /// Whom to answer.
    pub request: RequestId,
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
    effects: BTreeMap<u64, Effect>,
}

impl Pending {
    /// Keeps an effect; its ticket.
    pub fn keep(&mut self, effect: Effect) -> u64 {
        self.next += 1;
        self.effects.insert(self.next, effect);
        self.next
    }

    /// The effect of a ticket, once.
    pub fn take(&mut self, ticket: u64) -> Option<Effect> {
        self.effects.remove(&ticket)
    }

    /// Whether a patch waits for a model set to come into use.
    #[must_use]
    pub fn activates(&self, index: usize) -> bool {
        self.effects.values().any(|effect| matches!(effect, Effect::Activate { patch, .. } if *patch == index))
    }

    /// Whether a model set waits to come into use.
    #[must_use]
    pub fn activates_set(&self, id: &str) -> bool {
        self.effects.values().any(|effect| matches!(effect, Effect::Activate { set, .. } if set.id == id))
    }

    /// How many model sets will be known beyond those that are.
    #[must_use]
    pub fn imports(&self) -> usize {
        self.effects.values().filter(|effect| matches!(effect, Effect::Keep { .. })).count()
    }

    /// How a session is being ended.
    #[must_use]
    pub fn ends(&self, number: u64) -> Option<Trigger> {
        self.effects.values().find_map(|effect| match effect {
            Effect::End { command, view, .. } if view.number == number => Some(*command),
            _ => None,
        })
    }

    /// Whether something is being deleted.
    #[must_use]
    pub fn forgets(&self, gone: &Forgotten) -> bool {
        self.effects.values().any(|effect| matches!(effect, Effect::Forget { what, .. } if what == gone))
    }
}
