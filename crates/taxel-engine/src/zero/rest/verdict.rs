//! What the test of rest says, with the figures it says it by.

use std::fmt;

use super::limits::{MOVED_AWAY_MAX, MOVED_FEW_MAX, SCANS_MIN, STEADY_ERRORS_MAX};
use crate::request::ErrorReason;

/// From here on a zero lies so far towards load that what pressed before may still be in it, counts.
const RECOVERING_COUNTS: f64 = 0.3;

/// A figure beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Of what.
    pub figure: Figure,
    /// Position of the module; most of the skin without one.
    pub module: Option<usize>,
    /// What was measured.
    pub seen: f64,
    /// The limit.
    pub limit: f64,
}

/// What is measured of a watch. Counts are positive towards load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// How far the median taxel drifted over the watch, counts.
    Drift,
    /// How many taxels of a module moved from the first half of the watch to the second.
    Jumps,
    /// The noise of a module's third taxel, over what it is known to be.
    Noise,
    /// How unlike each other the modules moved, in standard deviations: a load may be spread over many.
    Unlike,
    /// How far the median taxel lies towards load, counts.
    Median,
    /// The same of so many taxels of a module, two or three, too few to move its median.
    Taxels(usize),
    /// How many taxels of a module stand still further towards load: they are broken, or beyond their range under a load.
    Standing,
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
    /// Something lies on the skin.
    Loaded(Beyond),
    /// The median lies so many counts away from load, which no day moves it: the baseline is of another zero of the boards, or
    /// was itself taken under load.
    OtherZero(f64),
    /// Something came or went while the skin was watched.
    Moved(Beyond),
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

impl Beyond {
    /// The first of these figures that is beyond its limit; each with the module that it is of, and what was measured.
    pub(super) fn first<const N: usize>(figures: [(Figure, (Option<usize>, f64), f64); N]) -> Option<Self> {
        let found = figures.into_iter().find(|(_, (_, seen), limit)| seen > limit)?;
        let (figure, (module, seen), limit) = found;
        Some(Self { figure, module, seen, limit })
    }

    fn place(&self, name: impl Fn(usize) -> String) -> String {
        self.module.map_or_else(|| "most of the skin".to_owned(), name)
    }

    /// Of what is lighter than its zero, in words.
    pub fn lighter_in_words(&self, name: impl Fn(usize) -> String) -> String {
        let on = if matches!(self.figure, Figure::Taxels(_)) { " on three taxels" } else { "" };
        format!("{} is {:.1} counts lighter than its zero{on}", self.place(name), self.seen)
    }

    /// In words, with the modules by the names that operators know.
    fn in_words(&self, name: impl Fn(usize) -> String) -> String {
        let (Self { figure, seen, limit, .. }, place) = (*self, self.place(name));
        match figure {
            Figure::Drift => format!("the whole skin moved ({seen:+.1} counts in the median, limit {limit:.1})"),
            Figure::Jumps => {
                format!("something moved on {place} ({seen} taxels by more than {STEADY_ERRORS_MAX} standard errors)")
            }
            Figure::Noise => {
                format!("something moved on {place} (three taxels have {seen:.1} times their noise, limit {limit})")
            }
            Figure::Unlike => {
                format!("something moved on several modules ({seen:.1} standard deviations apart, limit {limit})")
            }
            Figure::Median => format!("something presses on {place} ({seen:.1} counts, limit {limit})"),
            Figure::Standing => format!(
                "something presses on {place}, or {seen} taxels are broken (they stand more than {} counts towards load)",
                MOVED_FEW_MAX[0]
            ),
            Figure::Taxels(taxels) => {
                let taxels = if taxels == 2 { "two" } else { "three" };
                format!("something presses on {place} ({seen:.1} counts on {taxels} taxels, limit {limit})")
            }
        }
    }
}

impl RestVerdict {
    /// Whether the skin is at rest, as far as counts can show.
    pub const fn is_rest(&self) -> bool {
        matches!(self, Self::Rest { .. })
    }

    /// Whether enough was seen and nothing moved: then an operator may confirm what the counts cannot show.
    pub const fn is_still(&self) -> bool {
        !matches!(self.refusal(), ErrorReason::TareUnsteady | ErrorReason::SkinSilent)
    }

    /// Why no zero is taken of a skin that this was said of, unless somebody confirms it.
    pub const fn refusal(&self) -> ErrorReason {
        match self {
            Self::Loaded(_) => ErrorReason::TareLoaded,
            Self::Moved(_) => ErrorReason::TareUnsteady,
            Self::Rest { .. } | Self::OtherZero(_) | Self::Unproven { .. } => ErrorReason::TareUnproven,
            Self::TooShort(_) | Self::TooFew { .. } => ErrorReason::SkinSilent,
        }
    }

    /// In words, with the modules by the names that operators know.
    pub fn in_words(&self, name: impl Fn(usize) -> String) -> String {
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
            Self::Loaded(beyond) | Self::Moved(beyond) => beyond.in_words(name),
            Self::OtherZero(away) => {
                format!(
                    "the boards have another zero than the models ({away:.1} counts away from load, limit {MOVED_AWAY_MAX})"
                )
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
        f.write_str(&self.in_words(|module| format!("module {module}")))
    }
}
