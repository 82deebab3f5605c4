//! What a recalibration is made of: known loads with what the skin read under them, and what is assumed of a sound skin.

use serde::{Deserialize, Serialize};

use crate::loads::load::Load;

/// One load point. `read` and `known` are in one unit, newton for loads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadPoint {
    /// By what it is known to people: the number of the load.
    pub number: u64,
    /// What the skin read, with the areas as configured; above 0.
    pub read: f64,
    /// Standard uncertainty of `read` for itself, as it scatters in time; 0 or more.
    pub read_sigma: f64,
    /// What lay there; above 0.
    pub known: f64,
    /// Standard uncertainty of `known`; 0 or more.
    pub known_sigma: f64,
}

impl LoadPoint {
    /// A known load as it was read.
    ///
    /// The uncertainty that the force samples stated is not taken: most of it is common to all loads (gauge, hysteresis,
    /// area), which is what a gain takes out. What differs from place to place is in
    /// [`Assumptions`].
    #[must_use]
    pub fn of(load: &Load) -> Self {
        Self {
            number: load.number,
            read: load.read.mean_n,
            read_sigma: load.scatter_of_mean_n(),
            known: load.force_n,
            known_sigma: load.force_sigma_n,
        }
    }

    /// What is wrong with its figures, in words.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let above = |name: &str, value: f64| {
            let wrong = !(value.is_finite() && value > 0.0);
            wrong.then(|| format!("point {}: {name} is {value}, expected a number above 0", self.number))
        };
        let least = |name: &str, value: f64| {
            let wrong = !(value.is_finite() && value >= 0.0);
            wrong.then(|| format!("point {}: {name} is {value}, expected a number of 0 or more", self.number))
        };
        above("what was read", self.read)
            .or_else(|| above("the known load", self.known))
            .or_else(|| least("the uncertainty of what was read", self.read_sigma))
            .or_else(|| least("the uncertainty of the known load", self.known_sigma))
    }
}

/// Relative standard deviation of what a sound skin reads of masses from place to place, as simulated for masses above
/// 0.36 kg on pads that read 2 to 3 kPa a count.
pub const PLACE_REL: f64 = 0.03;

/// What a recalibration takes for granted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumptions {
    /// Relative standard deviation of what a sound skin reads from place to place, [`PLACE_REL_MIN`] to [`PLACE_REL_MAX`].
    pub place_rel: f64,
    /// Standard deviation that does not grow with the load, in the unit of the points; 0 or more.
    pub floor: f64,
}

impl Assumptions {
    /// Masses laid on a patch, in newton: [`PLACE_REL`] from place to place, and 0.1 N of a zero that is 0.1 kPa off over 30
    /// taxels.
    pub const MASSES: Self = Self { place_rel: PLACE_REL, floor: 0.1 };

    /// What is wrong with them, in words.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let (place, is_one) = (self.place_rel, (PLACE_REL_MIN..=PLACE_REL_MAX).contains(&self.place_rel));
        (!is_one)
            .then(|| format!("the scatter from place to place is {place}, expected {PLACE_REL_MIN} to {PLACE_REL_MAX}"))
    }
}

/// No skin of taxels with gaps is known to scatter less.
pub const PLACE_REL_MIN: f64 = 0.01;

/// A skin that scatters more than this cannot be set right by one gain.
pub const PLACE_REL_MAX: f64 = 0.2;
