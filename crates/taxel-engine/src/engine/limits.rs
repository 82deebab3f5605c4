//! How many things are kept, and what to do when there are as many.

use crate::engine::step::Engine;
use crate::loads::owner::LOADS_MAX;
use crate::patch::owner::Patch;
use crate::request::{ErrorReason, Rejection};

/// Model sets that are listed. Their summaries are in memory, half a kilobyte each, and the sets themselves on disk, half a
/// megabyte each of the forearm. A store that has more already is served whole and takes no further one.
pub const MODEL_SETS_MAX: usize = 1_000;

/// Sessions that are listed. Beyond these views, half a kilobyte each, nothing of them is in memory; their samples are on
/// disk.
pub const SESSIONS_MAX: usize = 10_000;

impl Engine {
    /// Refuses what would make one more model set.
    pub(super) fn room_for_model_set(&self) -> Result<(), Rejection> {
        let sets = self.model_sets.len() + self.pending.imports();
        limited(sets, MODEL_SETS_MAX, "model sets", "delete some with DeleteModelSet first")
    }

    /// Refuses what would make one more session.
    pub(super) fn room_for_session(&self) -> Result<(), Rejection> {
        limited(self.sessions.len(), SESSIONS_MAX, "sessions", "delete some with DeleteSession first")
    }

    /// Refuses what would make one more known load.
    pub(super) fn room_for_load(&self) -> Result<(), Rejection> {
        limited(self.patches.iter().map(Patch::loads).sum(), LOADS_MAX, "loads", "none can be added")
    }
}

fn limited(there: usize, max: usize, what: &str, then: &str) -> Result<(), Rejection> {
    let why = || format!("there are {there} {what}, and {max} is the limit: {then}");
    ErrorReason::LimitReached.unless(there < max, why)
}
