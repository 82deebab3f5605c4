//! What the thermal pads say of a zero that does not follow the temperature.
//!
//! No load reaches the pads, and warmth moves taxels by a quarter to all of what it moves them: the boards compensate the
//! rest. A skin that cools under a load on all of it may read as if nothing lay there, and only the pads show that.
//! With `d` the median over the modules of how far their pads moved away from load since the zero, the zero of all taxels
//! may be off by `k d`, `k` uniform from 1/4 to 1: a root mean square of `0.66 d`. Where they moved towards load nothing is
//! hidden: all taxels read too much then, which their own median tells.

use crate::statistics::median;

/// Root mean square of a coefficient that is uniform from 1/4 to 1: `sqrt((1 + 1/4 + 1/16) / 3)`.
pub(super) const COEFFICIENT_RMS: f64 = 0.661_437_827_766_147_6;

/// How far the pads have moved away from load since the zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Warmth {
    /// Mean of the pads of each module at the zero, counts; nothing where that is not known.
    at_zero: Vec<f64>,
    sigma_counts: f64,
}

impl Warmth {
    /// A zero was taken, with the pads of each module `at_zero`, counts; a module without pads has 0.
    pub(super) fn begin(&mut self, at_zero: Vec<f64>) {
        *self = Self { at_zero, sigma_counts: 0.0 };
    }

    /// The pads of each module are at `now`, counts. `towards_load` is the sign of a count's change under load.
    pub(super) fn look(&mut self, now: Vec<f64>, towards_load: f64) {
        if self.at_zero.is_empty() {
            self.at_zero = now;
            return;
        }
        let with_pads = now.iter().zip(&self.at_zero).filter(|(now, then)| **now > 0.0 && **then > 0.0);
        let moved = median(with_pads.map(|(now, then)| towards_load * (now - then))).unwrap_or(0.0);
        self.sigma_counts = COEFFICIENT_RMS * (-moved).max(0.0);
    }

    /// Standard uncertainty, in counts, of a zero that all taxels share, for the warmth since it was taken.
    pub(super) const fn sigma_counts(&self) -> f64 {
        self.sigma_counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(warmth: &mut Warmth, pads: [f64; 5]) -> f64 {
        warmth.look(pads.to_vec(), -1.0);
        warmth.sigma_counts()
    }

    #[test]
    fn a_skin_that_cools_may_have_moved_by_two_thirds_of_its_pads() {
        let mut warmth = Warmth::default();
        warmth.begin(vec![201.0; 5]);
        assert_eq!(look(&mut warmth, [201.0; 5]), 0.0);
        for moved in [2.0, 3.0] {
            let expected = moved * (21.0_f64 / 48.0).sqrt();
            assert!((look(&mut warmth, [201.0 + moved; 5]) - expected).abs() < 1e-12);
            assert_eq!(look(&mut warmth, [201.0 - moved; 5]), 0.0, "that is towards load");
        }
        warmth.begin(vec![204.0; 5]);
        assert_eq!(look(&mut warmth, [204.0; 5]), 0.0);
    }

    #[test]
    fn where_the_pads_at_the_zero_are_not_known_the_first_look_is_theirs() {
        let mut warmth = Warmth::default();
        warmth.begin(Vec::new());
        assert_eq!(look(&mut warmth, [201.0; 5]), 0.0);
        assert!((look(&mut warmth, [203.0; 5]) - 2.0 * COEFFICIENT_RMS).abs() < 1e-12);
    }

    #[test]
    fn modules_without_pads_and_a_broken_one_say_nothing() {
        let mut warmth = Warmth::default();
        warmth.begin(vec![200.0, 0.0, 200.0, 0.0, 200.0]);
        let sigma = look(&mut warmth, [201.0, 0.0, 0.0, 0.0, 255.0]);
        assert!((sigma - 28.0 * COEFFICIENT_RMS).abs() < 1e-12, "{sigma}");
        let sigma = look(&mut warmth, [201.0, 0.0, 201.0, 0.0, 255.0]);
        assert!((sigma - COEFFICIENT_RMS).abs() < 1e-12, "{sigma}");
        assert_eq!(look(&mut warmth, [0.0; 5]), 0.0);
    }
}
