//! What waits to be on disk before it takes effect: what is acknowledged is durable, what is refused has no effect.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::calibration::job::FitOutcome;
use crate::loads::load::Load;
use crate::model_set::ModelSet;
use crate::request::RequestId;

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
    /// A model set is known.
    Import {
        /// Whom to answer.
        request: RequestId,
        /// The set.
        set: Arc<ModelSet>,
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
    /// A fit ends its session.
    Fitted {
        /// Position of the patch.
        patch: usize,
        /// What it came to.
        outcome: FitOutcome,
    },
}

/// Effects by the ticket under which the shell writes them down.
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

    /// Whether some patch waits for this model set to come into use.
    #[must_use]
    pub fn brings_into_use(&self, id: &str) -> bool {
        self.effects.values().any(|effect| matches!(effect, Effect::Activate { set, .. } if set.id == id))
    }

    /// Whether a patch waits for a model set to come into use.
    #[must_use]
    pub fn activates(&self, index: usize) -> bool {
        self.effects.values().any(|effect| matches!(effect, Effect::Activate { patch, .. } if *patch == index))
    }
}
