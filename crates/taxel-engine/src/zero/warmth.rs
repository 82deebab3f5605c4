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

/// Means of the pads over windows of scans, the first of them that of the zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Warmth {
    /// Each pad of each module summed over the window.
    sums: Vec<[u32; 2]>,
    scans: u32,
    /// Mean of the pads of each module in the first window after the zero, counts.
    at_zero: Option<Vec<f64>>,
    sigma_counts: f64,
}

impl Warmth {
    /// A zero was taken, with the pads of each module `at_zero`, counts; the next window is its own if that is not known.
    pub(super) fn begin(&mut self, at_zero: Option<Vec<f64>>) {
        *self = Self { sums: std::mem::take(&mut self.sums), at_zero, ..Self::default() };
        self.restart();
    }

    /// The window begins anew.
    pub(super) fn restart(&mut self) {
        self.sums.clear();
        self.scans = 0;
    }

    /// The pads of a scan, two of each module; a module without pads has zeros.
    pub(super) fn push(&mut self, pads: &[[u8; 2]]) {
        self.sums.resize(pads.len(), [0; 2]);
        let sums = self.sums.as_flattened_mut().iter_mut().zip(pads.as_flattened());
        sums.for_each(|(sum, count)| *sum += u32::from(*count));
        self.scans += 1;
    }

    /// The window ends. `towards_load` is the sign of a count's change under load.
    pub(super) fn end(&mut self, towards_load: f64) {
        let scans = f64::from(self.scans.max(1));
        // Hands have one pad a module.
        let pads_of = |sums: &[u32; 2]| sums.iter().filter(|sum| **sum > 0).count().max(1) as f64;
        let mean = |sums: &[u32; 2]| f64::from(sums[0] + sums[1]) / (pads_of(sums) * scans);
        let means: Vec<f64> = self.sums.iter().map(mean).collect();
        if let Some(at_zero) = &self.at_zero {
            let with_pads = means.iter().zip(at_zero).filter(|(now, then)| **now > 0.0 && **then > 0.0);
            let moved = median(with_pads.map(|(now, then)| towards_load * (now - then))).unwrap_or(0.0);
            self.sigma_counts = COEFFICIENT_RMS * (-moved).max(0.0);
        } else {
            self.at_zero = Some(means);
        }
        self.restart();
    }

    /// Standard uncertainty, in counts, of a zero that all taxels share, for the warmth since it was taken.
    pub(super) const fn sigma_counts(&self) -> f64 {
        self.sigma_counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(warmth: &mut Warmth, pads: &[[u8; 2]]) -> f64 {
        (0..40).for_each(|_| warmth.push(pads));
        warmth.end(-1.0);
        warmth.sigma_counts()
    }

    #[test]
    fn a_skin_that_cools_may_have_moved_by_two_thirds_of_its_pads() {
        let mut warmth = Warmth::default();
        warmth.begin(None);
        assert_eq!(window(&mut warmth, &[[200, 202]; 5]), 0.0);
        assert_eq!(window(&mut warmth, &[[200, 202]; 5]), 0.0);
        for moved in [2, 3] {
            let expected = f64::from(moved) * (21.0_f64 / 48.0).sqrt();
            assert!((window(&mut warmth, &[[200 + moved, 202 + moved]; 5]) - expected).abs() < 1e-12);
            assert_eq!(window(&mut warmth, &[[200 - moved, 202 - moved]; 5]), 0.0, "that is towards load");
        }
        warmth.begin(None);
        assert_eq!(window(&mut warmth, &[[203, 205]; 5]), 0.0);
    }

    #[test]
    fn what_the_pads_moved_in_the_first_window_counts_where_they_are_known_from_before() {
        let mut warmth = Warmth::default();
        warmth.begin(Some(vec![201.0; 5]));
        let sigma = window(&mut warmth, &[[202, 204]; 5]);
        assert!((sigma - 2.0 * COEFFICIENT_RMS).abs() < 1e-12, "{sigma}");
        warmth.begin(Some(vec![200.0; 5]));
        let sigma = window(&mut warmth, &[[202, 0]; 5]);
        assert!((sigma - 2.0 * COEFFICIENT_RMS).abs() < 1e-12, "{sigma}: one pad a module");
    }

    #[test]
    fn modules_without_pads_and_a_broken_one_say_nothing() {
        let mut warmth = Warmth::default();
        warmth.begin(None);
        window(&mut warmth, &[[200, 200], [0, 0], [200, 200], [0, 0], [200, 200]]);
        let sigma = window(&mut warmth, &[[201, 201], [0, 0], [0, 0], [0, 0], [255, 255]]);
        assert!((sigma - 28.0 * COEFFICIENT_RMS).abs() < 1e-12, "{sigma}");
        let sigma = window(&mut warmth, &[[201, 201], [0, 0], [201, 201], [0, 0], [255, 255]]);
        assert!((sigma - COEFFICIENT_RMS).abs() < 1e-12, "{sigma}");
        assert_eq!(window(&mut warmth, &[[0, 0]; 5]), 0.0);
    }
}
