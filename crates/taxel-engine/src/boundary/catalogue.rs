//! Sessions, model sets and loads as readers see them, and as a store gives them back.

use std::sync::Arc;

use crate::calibration::samples::SessionSamples;
use crate::calibration::view::SessionView;
use crate::loads::load::Load;
use crate::loads::validation::Validation;
use crate::model_set::ModelSet;

/// Sessions and model sets as the store has them.
#[derive(Clone, Debug, Default)]
pub struct Catalogue {
    /// Oldest first.
    pub sessions: Vec<Arc<SessionView>>,
    /// Oldest first.
    pub model_sets: Vec<Arc<ModelSet>>,
    /// Per patch, in plan order: patch name and active model set.
    pub active: Vec<(String, Option<String>)>,
    /// Per patch, in plan order: its known loads.
    pub validations: Vec<Arc<Validation>>,
}

/// What the store found at start.
#[derive(Clone, Debug, Default)]
pub struct Restored {
    /// Every stored model set, oldest first.
    pub model_sets: Vec<Arc<ModelSet>>,
    /// Per patch name: the active model set.
    pub active: Vec<(String, String)>,
    /// Every session that ended, oldest first, and those that were interrupted (state `Interrupted`).
    pub sessions: Vec<RestoredSession>,
    /// The number that the next session gets.
    pub next_session: u64,
    /// Every known load, oldest first.
    pub loads: Vec<Arc<Load>>,
    /// The number that the next known load gets.
    pub next_load: u64,
}

/// A session as the store found it.
#[derive(Clone, Debug)]
pub struct RestoredSession {
    /// Its last state; a session that was under way is `Interrupted`.
    pub view: Arc<SessionView>,
    /// Its samples, if it can go on: it was interrupted, or it is the newest of its patch and waits for review.
    pub samples: Option<SessionSamples>,
}
