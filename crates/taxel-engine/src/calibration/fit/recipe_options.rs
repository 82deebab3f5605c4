//! How a recording is fitted, and why it cannot be.

use taxel_model::FitOptions;
use taxel_model::skin::SkinError;
use thiserror::Error;

use crate::calibration::branch::Branch;
use crate::intake::faults::limits::FaultLimits;

/// How a recording is fitted.
#[derive(Clone, Debug)]
pub struct FitRecipe {
    /// How each taxel is fitted.
    pub options: FitOptions,
    /// Which part is fitted.
    pub branch: Branch,
    /// Whether hysteresis is compensated, if that wins on what no fit saw: the last falling branch, or of a single one the lower half.
    pub plays: bool,
    /// So many neighbouring taxels form a module.
    pub module_size: usize,
    /// Counts are averaged over so many seconds for the plays and in use; 0 is not at all.
    pub smooth_s: f64,
    /// Limits of the faults.
    pub faults: FaultLimits,
}

impl Default for FitRecipe {
    fn default() -> Self {
        Self {
            options: FitOptions::default(),
            branch: Branch::Both,
            plays: true,
            module_size: 10,
            smooth_s: 0.5,
            faults: FaultLimits::default(),
        }
    }
}

impl FitRecipe {
    /// Whether the paper's equation is solved over the paper's samples: no fault is looked for, nothing is averaged,
    /// shifted in time or compensated, and only rising pressure has a say.
    #[must_use]
    pub fn is_paper(&self) -> bool {
        self.options.paper
    }
}

/// Why a recording cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RecordingError {
    /// A fit needs both.
    #[error("the recording has no pressure: expected a column `pressure_kpa` with finite numbers")]
    NoPressure,
    /// It tells nothing of the skin.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// The models are of another skin.
    #[error("the recording has {recorded} taxels, the model set {models}")]
    Taxels {
        /// Taxels of the recording.
        recorded: usize,
        /// Taxels of the set.
        models: usize,
    },
    /// A zero is asked for from more than there is.
    #[error("a zero from the first {tare_s} s is asked for, and the recording is {span_s:.1} s long")]
    TareTooLong {
        /// Seconds that the zero is to be taken from.
        tare_s: f64,
        /// Seconds from the first scan to the last.
        span_s: f64,
    },
}
