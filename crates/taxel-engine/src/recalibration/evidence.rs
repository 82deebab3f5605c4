//! What a recalibration is made of: a known load, and what the skin read under it.

use serde::{Deserialize, Serialize};

use crate::loads::load::Load;

/// One load point. `read` and `known` are in one unit: newton for loads, kilopascal for a recording with its gauge.
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
    /// A known load as it was read, without the factor that the areas were multiplied by at that time.
    ///
    /// The uncertainty that the force samples stated is not taken: most of it is common to all loads (gauge, hysteresis,
    /// area), which is what a gain takes out. What differs from place to place is in
    /// [`Assumptions`](crate::recalibration::assumptions::Assumptions).
    #[must_use]
    pub fn of(load: &Load) -> Self {
        Self {
            number: load.number,
            read: load.read.mean_n / load.area_factor,
            read_sigma: load.scatter_of_mean_n() / load.area_factor,
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
