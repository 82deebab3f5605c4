//! What a taxel reads at rest, and from where on it counts as touched.

/// Rest noise cannot be known better than the quantisation of one count: 1/sqrt(12).
pub const NOISE_FLOOR_COUNTS: f64 = 0.29;

/// What a taxel reads at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// The activation threshold of a taxel with this noise at rest: counts from rest towards pressure. The one formula
    /// for everybody: tables, the drift's search for touches, and readers of taxels.
    #[must_use]
    pub fn distance_counts(&self, noise_counts: f64) -> f64 {
        (self.sigmas * noise_counts.max(NOISE_FLOOR_COUNTS)).max(self.floor_counts)
    }
}

/// A zero's noise is no more than this times what the models know: a threshold in multiples of the noise must not grow
/// because something moved while the zero was taken.
const NOISE_GROWTH_MAX: f64 = 1.5;

/// A zero with a noise that is no more than `NOISE_GROWTH_MAX` times what is `known` of each taxel. A taxel that gave no
/// value at rest stays unknown.
#[must_use]
pub fn with_noise_capped(mut baseline: Vec<TaxelBaseline>, known: &[TaxelBaseline]) -> Vec<TaxelBaseline> {
    for (taxel, known) in baseline.iter_mut().zip(known) {
        // `min` would take the cap for a noise that is not a number.
        if taxel.noise.is_finite() && known.noise.is_finite() && known.noise > 0.0 {
            taxel.noise = taxel.noise.min(NOISE_GROWTH_MAX * known.noise.max(NOISE_FLOOR_COUNTS));
        }
    }
    baseline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noise_is_capped_by_what_is_known_and_an_unknown_taxel_stays_unknown() {
        let rest = |mean, noise| TaxelBaseline { mean, noise };
        let zero = vec![rest(240.0, 9.0), TaxelBaseline::UNKNOWN, rest(240.0, 9.0), rest(240.0, 0.5)];
        let known = [rest(239.0, 1.0), rest(239.0, 1.0), TaxelBaseline::UNKNOWN, rest(239.0, 1.0)];
        let capped = with_noise_capped(zero, &known);
        let noises: Vec<f64> = capped.iter().map(|taxel| taxel.noise).collect();
        assert_eq!((noises[0], noises[2], noises[3]), (1.5, 9.0, 0.5));
        assert!(capped[1].mean.is_nan() && capped[1].noise.is_nan(), "{:?}", capped[1]);
    }
}
