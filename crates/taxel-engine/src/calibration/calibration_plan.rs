//! What calibration needs to know of a patch, and how its sessions are fitted.

use std::ops::Range;

use taxel_model::FitOptions;

use crate::calibration::branch::Branch;
use crate::calibration::fit::recipe_options::FitRecipe;
use crate::calibration::limits::SessionLimits;
use crate::intake::faults::limits::FaultLimits;

/// What calibration needs to know of a patch.
#[derive(Clone, Debug)]
pub struct CalibrationPlan {
    /// The patch's name.
    pub patch: String,
    /// Which taxels form each module.
    pub modules: Vec<Range<usize>>,
    /// How many taxels there are.
    pub taxels: usize,
    /// The rules of a session.
    pub session: SessionLimits,
    /// How models are fitted.
    pub fit: FitOptions,
    /// When a taxel counts as faulty.
    pub faults: FaultLimits,
    /// Board settings that the counts depend on, in words: one line a board.
    pub board_settings: Vec<String>,
    /// Whether a simulator or a replayed log sends its scans.
    pub simulated: bool,
}

impl CalibrationPlan {
    /// How a session over these branches is fitted.
    pub fn recipe(&self, branch: Branch) -> FitRecipe {
        FitRecipe {
            options: self.fit,
            branch,
            plays: self.session.plays,
            faults: self.faults,
            // What a table of counts is cut into when this set is applied to one; live, each module has its own.
            module_size: self.modules.iter().map(ExactSizeIterator::len).max().unwrap_or(1),
            ..FitRecipe::default()
        }
    }
}
