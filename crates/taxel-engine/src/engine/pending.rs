//! What waits to be on disk before it takes effect: what is acknowledged is durable, what is refused has no effect.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::calibration::job::FitOutcome;
use crate::calibration::transition::Trigger;
use crate::calibration::view::SessionView;
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
    /// The model set of a fit of stored samples is known.
    Refit {
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
    /// A fit ends its session.
    Fitted {
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
pub struct Loading {
    /// Whom to answer.
    pub request: RequestId,
    /// Number of the session.
    pub session: u64,
    /// What is asked of it.
    pub command: Trigger,
}

/// A command to use a model set that is being read.
#[derive(Clone, Debug)]
pub struct LoadingSet {
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
    loads: BTreeMap<u64, Loading>,
    sets: BTreeMap<u64, LoadingSet>,
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

    /// Keeps a command until the samples of its session are read; its ticket.
    pub fn load(&mut self, loading: Loading) -> u64 {
        self.next += 1;
        self.loads.insert(self.next, loading);
        self.next
    }

    /// The command of a ticket, once.
    pub fn take_load(&mut self, ticket: u64) -> Option<Loading> {
        self.loads.remove(&ticket)
    }

    /// Keeps an activation until its set is read; its ticket.
    pub fn load_set(&mut self, loading: LoadingSet) -> u64 {
        self.next += 1;
        self.sets.insert(self.next, loading);
        self.next
    }

    /// The activation of a ticket, once.
    pub fn take_set(&mut self, ticket: u64) -> Option<LoadingSet> {
        self.sets.remove(&ticket)
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
        self.effects.values().filter(|effect| matches!(effect, Effect::Import { .. } | Effect::Refit { .. })).count()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ticket_is_another_one_and_is_good_for_what_it_was_given_for_once() {
        let mut pending = Pending::default();
        let request = RequestId(7);
        let forget = Effect::Forget { request, what: Forgotten::Session(3) };
        let zero = Effect::Zero { request, patch: 1 };
        let tickets = [
            pending.keep(forget),
            pending.load(Loading { request, session: 3, command: Trigger::StartRamp }),
            pending.load_set(LoadingSet { request, patch: 2, model_set: "m-1".to_owned(), expected: None }),
            pending.keep(zero),
        ];
        assert!((0..4).all(|i| !tickets[..i].contains(&tickets[i])), "{tickets:?}");
        assert!(pending.take(tickets[1]).is_none() && pending.take_load(tickets[0]).is_none());
        assert!(pending.forgets(&Forgotten::Session(3)) && !pending.forgets(&Forgotten::Session(4)));
        assert!(matches!(pending.take(tickets[3]), Some(Effect::Zero { patch: 1, .. })));
        assert!(pending.take(tickets[0]).is_some() && pending.take(tickets[0]).is_none());
        assert!(!pending.forgets(&Forgotten::Session(3)));
        assert_eq!(pending.take_load(tickets[1]).map(|loading| loading.session), Some(3));
        assert!(pending.take_load(tickets[1]).is_none());
        assert_eq!(pending.take_set(tickets[2]).map(|loading| loading.patch), Some(2));
        assert!(pending.take_set(tickets[2]).is_none());
        let view = Arc::new(SessionView { number: 3, ..SessionView::default() });
        pending.keep(Effect::End { request, command: Trigger::Discard, view });
        assert_eq!([3, 4].map(|number| pending.ends(number)), [Some(Trigger::Discard), None]);
        assert!(!pending.activates(1) && !pending.activates_set("m-1") && pending.imports() == 0);
    }
}
