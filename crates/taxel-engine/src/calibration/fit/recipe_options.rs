//! How a recording is fitted, and why it cannot be.

use taxel_model::skin::SkinError;
use taxel_model::{Estimator, FitOptions, Order, Plays};
use thiserror::Error;

use crate::calibration::branch::{Branch, PlaysChoice};
use crate::intake::faults::limits::FaultLimits;

/// How a recording is fitted.
#[derive(Clone, Debug)]
pub struct FitRecipe {
    /// How each taxel's static curve is fitted.
    pub options: FitOptions,
    /// Which part is fitted.
    pub branch: Branch,
    /// Which part of that the static curves go through. With [`Branch::Rising`] they are those of a load that comes on a skin
    /// at rest, as in a session, and the falling legs tell the hysteresis alone.
    pub curve: Branch,
    /// Whether hysteresis is compensated.
    pub plays: PlaysChoice,
    /// Order of the curve that the plays bend; `options` has that of the static one.
    pub plays_order: Order,
    /// So many neighbouring taxels form a module.
    pub module_size: usize,
    /// Counts are averaged over so many seconds for the plays and in use; 0 is not at all.
    pub smooth_s: f64,
    /// A lag of at most so many seconds between gauge and counts is looked for; 0 is none.
    pub max_lag_s: f64,
    /// A clock of the gauge's own is looked for within so many seconds, and used where it wins on a stretch that it was
    /// not found on; 0 is not at all.
    pub max_clock_s: f64,
    /// Whether what the gauge says while nothing presses is its own error, to be taken off.
    pub gauge_zero: bool,
    /// Limits of the faults.
    pub faults: FaultLimits,
}

impl Default for FitRecipe {
    fn default() -> Self {
        Self {
            options: FitOptions::default(),
            branch: Branch::Both,
            curve: Branch::Both,
            plays: PlaysChoice::default(),
            plays_order: Plays::DEFAULT_ORDER,
            module_size: 10,
            smooth_s: 0.5,
            max_lag_s: 0.0,
            max_clock_s: 8.0,
            gauge_zero: false,
            faults: FaultLimits::default(),
        }
    }
}

impl FitRecipe {
    /// Whether the paper's equation is solved over the paper's samples: no fault is looked for, nothing is averaged,
    /// shifted in time or compensated, and only rising pressure has a say.
    #[must_use]
    pub fn is_paper(&self) -> bool {
        self.options.estimator == Estimator::Paper
    }

    /// The recipe with everything that its estimator leaves no choice in.
    #[must_use]
    pub fn settled(&self) -> Self {
        if !self.is_paper() {
            return self.clone();
        }
        let (branch, plays) = (Branch::Rising, PlaysChoice::Off);
        Self { branch, plays, smooth_s: 0.0, max_lag_s: 0.0, gauge_zero: false, ..self.clone() }
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
