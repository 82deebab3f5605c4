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
            Self::Median(moved, max) => {
                write!(
                    f,
                    "its median taxel moved by {moved:.2} counts from the first half to the second, at rest by at \
                           most {max:.2}"
                )
            }
            Self::Third(errors, max) => {
                write!(f, "three of its taxels moved by {errors:.1} standard errors and more, at rest by at most {max}")
            }
            Self::Noise(ratio, max) => {
                write!(f, "three of its taxels have {ratio:.1} times their noise and more, at rest at most {max}")
            }
            Self::Single { taxels, all } => {
                let whose = if *all { "taxels of the skin, one of them its own," } else { "of its taxels" };
                write!(
                    f,
                    "{taxels} {whose} moved by more than {STEADY_ERRORS_MAX} standard errors from the first half to the \
                     second"
                )
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
        let figures = |figures: &RestFigures| figures.told(name);
        match self {
            Self::Rest { figures: of } if of.moved_median >= RECOVERING_COUNTS => write!(
                f,
                "at rest: {}; the skin may still be recovering from what pressed on it: a zero that is taken some minutes \
                 later sees lighter loads",
                figures(of)
            ),
            Self::Rest { figures: of } => write!(f, "at rest: {}", figures(of)),
            Self::Loaded { figures: of, moved_median_max, moved_module_max } => write!(
                f,
                "loaded: {}; at rest the median moves by at most {moved_median_max} counts towards load and a module by at \
                 most {moved_module_max} more",
                figures(of)
            ),
            Self::OtherZero { figures: of, moved_away_max } => write!(
                f,
                "another zero: {}; at rest the median moves by at most {moved_away_max} counts away from load",
                figures(of)
            ),
            Self::LoadedInPart { module, taxels, moved, moved_max, from_zero } => {
                let since = if *from_zero { "the present zero" } else { "the calibration" };
                let taxels = if *taxels == 2 { "two" } else { "three" };
                write!(
                    f,
                    "loaded: {taxels} taxels of {} moved {moved:.2} counts and more towards load since {since}, at rest by \
                     at most {moved_max}",
                    name(*module)
                )
            }
            Self::Standing { module, taxels, moved_max } => write!(
                f,
                "loaded: {taxels} taxels of {} stand still more than {moved_max} counts towards load: they are broken, or \
                 beyond their range under a load",
                name(*module)
            ),
            Self::Unsteady { module, what } => write!(f, "restless: something moved on {}: {what}", name(*module)),
            Self::Unlike { unlikeness, unlikeness_max } => write!(
                f,
                "restless: something came or went, perhaps spread over many modules: they moved more unlike each other than their \
                 noise explains, by {unlikeness:.1} standard deviations, at rest by at most {unlikeness_max}"
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
        f.write_str(&self.told(&|module| format!("module {module}")))
    }
}

impl RestFigures {
    fn told(&self, name: Name<'_>) -> String {
        let share = 100.0 * self.share_one_sided;
        let worst =
            self.worst_module.map(|module| format!(", {} by {:.2} more", name(module), self.worst_module_moved));
        format!(
            "{} taxels moved {:+.2} counts towards load in the median, {share:.0} % of them that way{}",
            self.taxels,
            self.moved_median,
            worst.unwrap_or_default()
        )
    }
}
