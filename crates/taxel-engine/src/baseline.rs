//! What a taxel reads at rest, and from where on it counts as touched.

use serde::{Deserialize, Serialize};

/// Rest noise cannot be known better than the quantisation of one count: 1/sqrt(12).
pub const NOISE_FLOOR_COUNTS: f64 = 0.29;

/// What a taxel reads at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaxelBaseline {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation of a single reading, counts.
    pub noise: f64,
}

impl TaxelBaseline {
    /// That of a taxel of which nothing is known.
    pub const UNKNOWN: Self = Self { mean: f64::NAN, noise: f64::NAN };
}

/// When a taxel counts as touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// Multiple of the rest noise.
    pub sigmas: f64,
    /// Least distance from rest, in counts.
    pub floor_counts: f64,
}

impl Activation {
    /// That of every skin.
    pub const OF_SKIN: Self = Self { sigmas: 4.0, floor_counts: 2.0 };

    /// The activation threshold of a taxel with this noise at rest: counts from rest towards pressure. The one formula
    /// for everybody: tables, the drift's search for touches, and readers of taxels.
    #[must_use]
    pub fn distance_counts(&self, noise_counts: f64) -> f64 {
        (self.sigmas * noise_counts.max(NOISE_FLOOR_COUNTS)).max(self.floor_counts)
    }
}

/// A zero's noise is taken for no more than this times what the models know: a threshold in multiples of the noise must not
/// grow because something moved while the zero was taken.
const NOISE_GROWTH_MAX: f64 = 1.5;

/// A zero with the noise that it and the models know of each taxel together: the root of the mean of both squares, where the
/// zero's is no more than `NOISE_GROWTH_MAX` times the models'. A taxel that gave no value at rest stays unknown.
///
/// A zero of a second sees twenty readings: their scatter is off by 16 %, and of 230 taxels that of fourteen by more than 30 %. A
/// threshold of four such deviations would be reached by noise every second.
#[must_use]
pub fn with_noise_known(mut baseline: Vec<TaxelBaseline>, known: &[TaxelBaseline]) -> Vec<TaxelBaseline> {
    for (taxel, known) in baseline.iter_mut().zip(known) {
        // `min` would take the cap for a noise that is not a number.
        if taxel.noise.is_finite() && known.noise.is_finite() && known.noise > 0.0 {
            let known = known.noise.max(NOISE_FLOOR_COUNTS);
            let seen = taxel.noise.min(NOISE_GROWTH_MAX * known);
            taxel.noise = (0.5 * (seen * seen + known * known)).sqrt();
        }
    }
    baseline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noise_is_what_both_know_and_an_unknown_taxel_stays_unknown() {
        let rest = |mean, noise| TaxelBaseline { mean, noise };
        let zero = vec![rest(240.0, 9.0), TaxelBaseline::UNKNOWN, rest(240.0, 9.0), rest(240.0, 0.5)];
        let known = [rest(239.0, 1.0), rest(239.0, 1.0), TaxelBaseline::UNKNOWN, rest(239.0, 1.0)];
        let both = with_noise_known(zero, &known);
        let noises: Vec<f64> = both.iter().map(|taxel| taxel.noise).collect();
        assert_eq!((noises[0], noises[2], noises[3]), (1.625_f64.sqrt(), 9.0, 0.625_f64.sqrt()));
        assert!(both[1].mean.is_nan() && both[1].noise.is_nan(), "{:?}", both[1]);
    }
}
