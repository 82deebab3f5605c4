//! What the test of rest says, with the figures it says it by.

use std::fmt;

/// What was measured on a still skin. Counts are positive in the direction of load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestFigures {
    /// Taxels that took part.
    pub taxels: usize,
    /// How far the median taxel has moved from its baseline, counts.
    pub moved_median: f64,
    /// Share of the taxels that moved in the direction of load, 0 to 1.
    pub share_one_sided: f64,
    /// The module that moved furthest in the direction of load.
    pub worst_module: Option<usize>,
    /// How far it moved beyond the median of all, counts.
    pub worst_module_moved: f64,
    /// Drift of the median taxel over the window, counts.
    pub drift: f64,
    /// The median taxel's noise over its noise at rest.
    pub noise_ratio: f64,
}

/// What the test says.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RestVerdict {
    /// The skin is at rest, as far as counts can show.
    Rest {
        /// What was measured.
        figures: RestFigures,
    },
    /// Something lies on it.
    Loaded {
        /// What was measured.
        figures: RestFigures,
        /// The limit for the median taxel, counts.
        moved_median_max: f64,
        /// The limit for a module, counts.
        moved_module_max: f64,
    },
    /// The counts are further in the unloading direction than a day moves them: the baseline is of another zero of
    /// the boards, or was itself taken under load.
    OtherZero {
        /// What was measured.
        figures: RestFigures,
        /// The limit, counts.
        moved_away_max: f64,
    },
    /// The counts move within the window.
    Restless {
        /// Drift of the median taxel over the window, counts.
        drift: f64,
        /// Its limit, counts.
        drift_max: f64,
        /// The median taxel's noise over its noise at rest; NaN if the drift decided.
        noise_ratio: f64,
        /// Its limit; NaN if the drift decided.
        noise_ratio_max: f64,
    },
    /// The skin is still, but there is no baseline to compare it with.
    Unproven {
        /// Taxels that took part.
        taxels: usize,
        /// Drift of the median taxel over the window, counts.
        drift: f64,
        /// Noise of the median taxel, counts.
        noise: f64,
    },
    /// Too few scans or taxels to say.
    NotEnough {
        /// Scans seen.
        scans: u64,
        /// Scans needed.
        scans_min: u64,
        /// Taxels with a sound value.
        sound: usize,
        /// Taxels with a baseline and a known sign.
        comparable: usize,
    },
}

impl fmt::Display for RestVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rest { figures } => write!(f, "at rest: {figures}"),
            Self::Loaded { figures, moved_median_max, moved_module_max } => write!(
                f,
                "loaded: {figures}; at rest the median moves by at most {moved_median_max} counts towards load and a \
                 module by at most {moved_module_max} more"
            ),
            Self::OtherZero { figures, moved_away_max } => write!(
                f,
                "another zero: {figures}; at rest the median moves by at most {moved_away_max} counts away from load"
            ),
            Self::Restless { drift, drift_max, noise_ratio, .. } if noise_ratio.is_nan() => {
                write!(f, "restless: the median taxel drifts by {drift:+.2} counts, at rest by at most {drift_max:.2}")
            }
            Self::Restless { noise_ratio, noise_ratio_max, .. } => write!(
                f,
                "restless: the median taxel's noise is {noise_ratio:.1} times that at rest, expected at most \
                 {noise_ratio_max}"
            ),
            Self::Unproven { taxels, drift, noise } => write!(
                f,
                "still, but without a baseline to compare with: {taxels} taxels, drift {drift:+.2} counts, noise \
                 {noise:.2} counts"
            ),
            Self::NotEnough { scans, scans_min, .. } if scans < scans_min => {
                write!(f, "too little was seen: {scans} scans, {scans_min} are needed")
            }
            Self::NotEnough { sound, comparable, .. } => {
                write!(f, "too few sound taxels: {sound} of the {comparable} that have a baseline and a model")
            }
        }
    }
}

impl fmt::Display for RestFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = 100.0 * self.share_one_sided;
        write!(f, "{} taxels moved {:+.2} counts towards load in the median, ", self.taxels, self.moved_median)?;
        write!(f, "{share:.0} % of them that way")?;
        match self.worst_module {
            Some(module) => write!(f, ", module {module} by {:.2} more", self.worst_module_moved),
            None => Ok(()),
        }
    }
}

/// The skin became lighter than its zero: the zero was taken under load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lift {
    /// How much lighter the median taxel is, counts.
    pub median: f64,
    /// The module that is lightest against its zero.
    pub module: Option<usize>,
    /// How much lighter it is, counts.
    pub module_lift: f64,
}

impl fmt::Display for Lift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the skin is {:.2} counts lighter than its zero in the median", self.median)?;
        match self.module {
            Some(module) => write!(f, ", module {module} by {:.2}", self.module_lift),
            None => Ok(()),
        }
    }
}
