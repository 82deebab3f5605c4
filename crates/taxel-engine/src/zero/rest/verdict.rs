//! What the test of rest says, with the figures it says it by.

use std::fmt;

use super::statistics::STEADY_ERRORS_MAX;
use crate::request::ErrorReason;

/// From here on a zero lies so far towards load that what pressed before may still be in it, counts.
const RECOVERING_COUNTS: f64 = 0.3;

/// What was measured on a still skin. Counts are positive in the direction of load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestFigures {
    /// Taxels that took part.
    pub taxels: usize,
    /// How far the median taxel has moved from its baseline, counts.
    pub moved_median: f64,
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
    /// Some taxels of a module moved into the direction of load, too few to move its median.
    LoadedInPart {
        /// The module.
        module: usize,
        /// How many of its taxels moved so far: two or three.
        taxels: u8,
        /// How far the least of these moved beyond the median of all, counts.
        moved: f64,
        /// The limit, counts.
        moved_max: f64,
        /// Whether it is compared with the zero that holds now, else with that of the models.
        from_zero: bool,
    },
    /// Some taxels of a module stand still far towards load: they are broken, or beyond their range under a load.
    Standing {
        /// The module.
        module: usize,
        /// How many of its taxels stand so.
        taxels: usize,
        /// The limit, counts.
        moved_max: f64,
    },
    /// Something came or went while the skin was watched.
    Unsteady {
        /// The module.
        module: usize,
        /// What moved: its median or its third taxel from the first half to the second, or its third taxel's noise.
        what: Unsteadiness,
    },
    /// Something came or went that may be spread over many modules: each moved within its noise, all together by more.
    Unlike {
        /// How unlike each other the modules moved, as a standard normal deviate.
        unlikeness: f64,
        /// Its limit.
        unlikeness_max: f64,
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

impl RestVerdict {
    /// Whether enough was seen and nothing moved: then an operator may vouch for what the counts cannot show.
    #[must_use]
    pub const fn is_still(&self) -> bool {
        match self {
            Self::Rest { .. }
            | Self::Loaded { .. }
            | Self::LoadedInPart { .. }
            | Self::Standing { .. }
            | Self::OtherZero { .. }
            | Self::Unproven { .. } => true,
            Self::Restless { .. } | Self::Unsteady { .. } | Self::Unlike { .. } | Self::NotEnough { .. } => false,
        }
    }
}

impl RestVerdict {
    /// Whether something lies on the skin.
    #[must_use]
    pub const fn is_loaded(&self) -> bool {
        matches!(self, Self::Loaded { .. } | Self::LoadedInPart { .. } | Self::Standing { .. })
    }

    /// Why no zero is taken of a skin that this was said of, unless somebody vouches for it.
    #[must_use]
    pub const fn refusal(&self) -> ErrorReason {
        match self {
            Self::Loaded { .. } | Self::LoadedInPart { .. } | Self::Standing { .. } => ErrorReason::TareLoaded,
            Self::Restless { .. } | Self::Unsteady { .. } | Self::Unlike { .. } => ErrorReason::TareUnsteady,
            Self::Rest { .. } | Self::OtherZero { .. } | Self::Unproven { .. } => ErrorReason::TareUnproven,
            Self::NotEnough { .. } => ErrorReason::SkinSilent,
        }
    }
}

/// How a module moved while it was watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsteadiness {
    /// Its median taxel, from the first half to the second, in counts, and the limit.
    Median(f64, f64),
    /// Its third taxel, from the first half to the second, in standard errors, and the limit.
    Third(f64, f64),
    /// The noise of its third taxel, over what it is known to be, and the limit.
    Noise(f64, f64),
    /// So many of its taxels, or of all modules', each by far more than its noise.
    Single {
        /// How many moved.
        taxels: usize,
        /// Whether those of all modules are meant.
        all: bool,
    },
}

impl fmt::Display for Unsteadiness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Median(moved, max) => write!(f, "{moved:.1} counts between the halves of the watch, limit {max:.1}"),
            Self::Third(errors, max) => write!(f, "three taxels by {errors:.1} standard errors, limit {max}"),
            Self::Noise(ratio, max) => write!(f, "three taxels have {ratio:.1} times their noise, limit {max}"),
            Self::Single { taxels, all: false } => {
                write!(f, "{taxels} taxels by more than {STEADY_ERRORS_MAX} standard errors")
            }
            Self::Single { taxels, all: true } => {
                write!(f, "{taxels} taxels of the skin by more than {STEADY_ERRORS_MAX} standard errors")
            }
        }
    }
}

/// What a module is called, by its position in the patch.
type Name<'a> = &'a dyn Fn(usize) -> String;

/// A verdict whose modules have names.
struct Told<'a>(&'a RestVerdict, Name<'a>);

impl fmt::Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.write(f, self.1)
    }
}

impl fmt::Display for RestVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, &|module| format!("module {module}"))
    }
}

impl RestVerdict {
    /// In words, with the modules by the names that they have for whoever looks for them.
    #[must_use]
    pub fn told(&self, name: impl Fn(usize) -> String) -> String {
        Told(self, &name).to_string()
    }

    fn write(&self, f: &mut fmt::Formatter<'_>, name: Name<'_>) -> fmt::Result {
        match self {
            Self::Rest { figures } => {
                write!(f, "unloaded: {}", figures.told(name))?;
                let recovers = figures.moved_median >= RECOVERING_COUNTS;
                f.write_str(if recovers {
                    "; the skin may still recover from a load: a later zero sees lighter ones"
                } else {
                    ""
                })
            }
            Self::Loaded { figures, moved_median_max, moved_module_max } => {
                let on_module = figures.worst_module.filter(|_| figures.worst_module_moved > *moved_module_max);
                let (place, moved, limit) = match on_module {
                    Some(module) => (name(module), figures.worst_module_moved, moved_module_max),
                    None => ("most of the skin".to_owned(), figures.moved_median, moved_median_max),
                };
                write!(f, "something presses on {place} ({moved:.1} counts, limit {limit})")
            }
            Self::OtherZero { figures, moved_away_max } => write!(
                f,
                "the boards have another zero than the models ({:.1} counts away from load, limit {moved_away_max})",
                -figures.moved_median
            ),
            Self::LoadedInPart { module, taxels, moved, moved_max, .. } => {
                let taxels = if *taxels == 2 { "two" } else { "three" };
                let place = name(*module);
                write!(f, "something presses on {place} ({moved:.1} counts on {taxels} taxels, limit {moved_max})")
            }
            Self::Standing { module, taxels, moved_max } => write!(
                f,
                "something presses on {0}, or {taxels} taxels are broken (they stand more than {moved_max} counts towards load)",
                name(*module)
            ),
            Self::Unsteady { module, what } => write!(f, "something moved on {} ({what})", name(*module)),
            Self::Unlike { unlikeness, unlikeness_max } => write!(
                f,
                "something moved on several modules ({unlikeness:.1} standard deviations apart, limit {unlikeness_max})"
            ),
            Self::Restless { drift, drift_max, noise_ratio, .. } if noise_ratio.is_nan() => {
                write!(f, "the whole skin moved ({drift:+.1} counts in the median, limit {drift_max:.1})")
            }
            Self::Restless { noise_ratio, noise_ratio_max, .. } => {
                write!(f, "the whole skin trembled ({noise_ratio:.1} times its noise, limit {noise_ratio_max})")
            }
            Self::Unproven { taxels, drift, noise } => write!(
                f,
                "still, but no calibration to compare with ({taxels} taxels, drift {drift:+.2} counts, noise {noise:.2})"
            ),
            Self::NotEnough { scans, scans_min, .. } if scans < scans_min => {
                write!(f, "too little was seen ({scans} scans, at least {scans_min})")
            }
            Self::NotEnough { sound, comparable, .. } => {
                write!(f, "too few sound taxels ({sound} of the {comparable} that have a model)")
            }
        }
    }
}

impl fmt::Display for RestFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(&|module| format!("module {module}")))
    }
}

impl RestFigures {
    fn told(&self, name: Name<'_>) -> String {
        let worst =
            self.worst_module.map(|module| format!(", largest {:.1} ({})", self.worst_module_moved, name(module)));
        format!("median shift {:.2} counts{}", self.moved_median, worst.unwrap_or_default())
    }
}
