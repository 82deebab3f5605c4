//! What the test of rest says, with the figures it says it by.

use std::fmt;

use taxel_skin::counted;

use super::limits::{MOVED_AWAY_MAX, NOISE_RATIO_MAX, SCANS_MIN, STEADY_ERRORS_MAX, THIRD_ERRORS_MAX, THIRD_NOISE_MAX};
use crate::request::ErrorReason;

/// From here on a zero lies so far towards load that what pressed before may still be in it, counts.
const RECOVERING_COUNTS: f64 = 0.3;

/// A figure beyond its limit, and on which module; on most of the skin without one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Position of the module.
    pub module: Option<usize>,
    /// What was measured.
    pub seen: f64,
    /// The limit.
    pub limit: f64,
}

/// What the test says. Counts are positive towards load.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RestVerdict {
    /// The skin is at rest, as far as counts can show.
    Rest {
        /// How far the median taxel lies from its baseline, counts.
        median: f64,
        /// The module that lies furthest towards load beyond that, and how far.
        worst: Option<(usize, f64)>,
    },
    /// Something lies on a module, or on most of the skin; in counts of the median taxel.
    Loaded(Beyond),
    /// Something lies on so many taxels of a module, two or three, too few to move its median; in counts.
    LoadedInPart(u8, Beyond),
    /// So many taxels of a module stand still further towards load than the limit: they are broken, or beyond their range under a
    /// load.
    Standing(usize, Beyond),
    /// The median lies so many counts away from load, which no day moves it: the baseline is of another zero of the boards, or
    /// was itself taken under load.
    OtherZero(f64),
    /// Something came or went on a module while the skin was watched.
    Unsteady(usize, Unsteadiness),
    /// Something came or went that may be spread over many modules: each moved within its noise, all together by more standard
    /// deviations than the limit.
    Unlike(Beyond),
    /// The median taxel drifted over the window, counts.
    Restless(Beyond),
    /// The median taxel has so many times its noise at rest.
    Trembling(f64),
    /// The skin is still, but there is no baseline to compare it with.
    Unproven {
        /// Taxels that took part.
        taxels: usize,
        /// Drift of the median taxel over the window, counts.
        drift: f64,
        /// Noise of the median taxel, counts.
        noise: f64,
    },
    /// Too few scans to say.
    TooShort(u64),
    /// Too few taxels to say.
    TooFew {
        /// Taxels with a sound value.
        sound: usize,
        /// Taxels with a baseline and a known sign.
        comparable: usize,
    },
}

/// How a module moved while it was watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsteadiness {
    /// Its median taxel, from the first half to the second, in counts, and the limit.
    Median(f64, f64),
    /// Its third taxel, from the first half to the second, in standard errors.
    Third(f64),
    /// The noise of its third taxel, over what it is known to be.
    Noise(f64),
    /// So many of its taxels each by far more than its noise.
    Jumps(usize),
    /// So many taxels of all modules.
    JumpsOfSkin(usize),
}

impl fmt::Display for Unsteadiness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Median(moved, max) => write!(f, "{moved:.1} counts between the halves of the watch, limit {max:.1}"),
            Self::Third(errors) => write!(f, "three taxels by {errors:.1} standard errors, limit {THIRD_ERRORS_MAX}"),
            Self::Noise(ratio) => write!(f, "three taxels have {ratio:.1} times their noise, limit {THIRD_NOISE_MAX}"),
            Self::Jumps(taxels) => {
                write!(f, "{} by more than {STEADY_ERRORS_MAX} standard errors", counted(*taxels, "taxel", "taxels"))
            }
            Self::JumpsOfSkin(taxels) => {
                let taxels = counted(*taxels, "taxel", "taxels");
                write!(f, "{taxels} of the skin by more than {STEADY_ERRORS_MAX} standard errors")
            }
        }
    }
}

impl RestVerdict {
    /// Whether the skin is at rest, as far as counts can show.
    pub const fn is_rest(&self) -> bool {
        matches!(self, Self::Rest { .. })
    }

    /// Whether enough was seen and nothing moved: then an operator may vouch for what the counts cannot show.
    pub const fn is_still(&self) -> bool {
        !matches!(self.refusal(), ErrorReason::TareUnsteady | ErrorReason::SkinSilent)
    }

    /// Why no zero is taken of a skin that this was said of, unless somebody vouches for it.
    pub const fn refusal(&self) -> ErrorReason {
        match self {
            Self::Loaded(_) | Self::LoadedInPart(..) | Self::Standing(..) => ErrorReason::TareLoaded,
            Self::Restless(_) | Self::Trembling(_) | Self::Unsteady(..) | Self::Unlike(_) => ErrorReason::TareUnsteady,
            Self::Rest { .. } | Self::OtherZero(_) | Self::Unproven { .. } => ErrorReason::TareUnproven,
            Self::TooShort(_) | Self::TooFew { .. } => ErrorReason::SkinSilent,
        }
    }

    /// In words, with the modules by the names that they have for whoever looks for them.
    pub fn told(&self, name: impl Fn(usize) -> String) -> String {
        let place = |beyond: &Beyond| beyond.module.map_or_else(|| "most of the skin".to_owned(), &name);
        match self {
            Self::Rest { median, worst } => {
                // What a module moved beyond the others is said with what all moved: the largest is never less than the median.
                let worst = worst
                    .map(|(module, beyond)| format!(", largest {:.1} ({})", median.max(0.0) + beyond, name(module)));
                let recovers = "; the skin may still be recovering from a load: tare again in some minutes to detect lighter \
                                loads";
                let recovers = if *median >= RECOVERING_COUNTS { recovers } else { "" };
                let worst = worst.unwrap_or_default();
                format!("unloaded: median shift from the models' zero {median:.2} counts{worst}{recovers}")
            }
            Self::Loaded(beyond @ Beyond { seen, limit, .. }) => {
                format!("something presses on {} ({seen:.1} counts, limit {limit})", place(beyond))
            }
            Self::LoadedInPart(taxels, beyond @ Beyond { seen, limit, .. }) => {
                let taxels = if *taxels == 2 { "two" } else { "three" };
                format!("something presses on {} ({seen:.1} counts on {taxels} taxels, limit {limit})", place(beyond))
            }
            Self::Standing(taxels, beyond) => format!(
                "something presses on {}, or {taxels} taxels are broken (they stand more than {} counts towards load)",
                place(beyond),
                beyond.limit
            ),
            Self::OtherZero(away) => {
                format!(
                    "the boards have another zero than the models ({away:.1} counts away from load, limit {MOVED_AWAY_MAX})"
                )
            }
            Self::Unsteady(module, what) => format!("something moved on {} ({what})", name(*module)),
            Self::Unlike(Beyond { seen, limit, .. }) => {
                format!("something moved on several modules ({seen:.1} standard deviations apart, limit {limit})")
            }
            Self::Restless(Beyond { seen, limit, .. }) => {
                format!("the whole skin moved ({seen:+.1} counts in the median, limit {limit:.1})")
            }
            Self::Trembling(ratio) => {
                format!("the whole skin trembled ({ratio:.1} times its noise, limit {NOISE_RATIO_MAX})")
            }
            Self::Unproven { taxels, drift, noise } => format!(
                "the counts stand still, but there is no calibration to compare with ({taxels} taxels, drift {drift:+.2} counts, noise {noise:.2})"
            ),
            Self::TooShort(scans) => format!("too little was seen ({scans} scans, at least {SCANS_MIN})"),
            Self::TooFew { sound, comparable } => {
                format!("too few sound taxels ({sound} of the {comparable} that have a model)")
            }
        }
    }
}

impl fmt::Display for RestVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(|module| format!("module {module}")))
    }
}
