//! Sessions, model sets and loads as readers see them, and as a store gives them back.

use std::sync::Arc;

use crate::calibration::view::SessionView;
use crate::known_set::KnownSet;
use crate::loads::load::Load;
use crate::loads::load::Validation;
use crate::zero::kept::KeptZero;

/// Sessions and model sets as the store has them.
#[derive(Clone, Debug, Default)]
pub struct Catalogue {
    /// Oldest first.
    pub sessions: Vec<Arc<SessionView>>,
    /// Oldest first. Those in use are at hand.
    pub model_sets: Vec<KnownSet>,
    /// Per patch, in plan order: patch name and active model set.
    pub active: Vec<(String, Option<String>)>,
    /// Per patch, in plan order: its known loads.
    pub validations: Vec<Arc<Validation>>,
}

/// What the store found at start.
#[derive(Clone, Debug, Default)]
pub struct Restored {
    /// Every stored model set, oldest first. Those that are active are at hand, the others stay in the store until somebody
    /// asks for one.
    pub model_sets: Vec<KnownSet>,
    /// Per patch name: the active model set.
    pub active: Vec<(String, String)>,
    /// Every session that ended, oldest first, and those that were interrupted (state `Interrupted`). Their samples stay
    /// in the store until one is taken up again.
    pub sessions: Vec<Arc<SessionView>>,
    /// The number that the next session gets.
    pub next_session: u64,
    /// Every known load, oldest first.
    pub loads: Vec<Arc<Load>>,
    /// The number that the next known load gets.
    pub next_load: u64,
    /// Per patch name: what is known of its zero and of those of its boards, which keep them while the daemon is away.
    pub zeros: Vec<(String, KeptZero)>,
    /// What was found damaged and left out, a line each.
    pub problems: Vec<String>,
}
