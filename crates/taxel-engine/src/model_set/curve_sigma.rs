//! What a calibration leaves open of its own pressures, in all of a contact alike.
//!
//! Two things tell how far the pressures of a session were off that no scatter of a single taxel shows. Ramps that were run one
//! after the other should give one curve: what they differ by is in no curve. And at the zero nothing presses: what a curve
//! reads there was either not on the taxel (a bag that bridged it, a gauge ahead of the skin) or is the form of the curve.
//! Neighbouring taxels share both, so neither averages out over a contact.

use taxel_model::{RangeState, Reading};

use super::ModelSet;
use crate::statistics::median;

impl ModelSet {
    /// Standard uncertainty that every reading of a taxel shares with those beside it, kPa; one per taxel, 0 without a usable model.
    pub(crate) fn curve_sigmas_kpa(&self) -> Vec<f64> {
        let usable = || (0..self.taxels.len()).filter(|&taxel| self.taxels[taxel].is_usable());
        // How far two ramps lie apart is known of each taxel, with the noise of one in it.
        let known =
            usable().filter_map(|taxel| self.taxels[taxel].quality.repeatability_kpa.filter(|kpa| kpa.is_finite()));
        let repeatability_kpa = median(known).unwrap_or(0.0);
        let mut curve_sigmas_kpa = vec![0.0; self.taxels.len()];
        usable().for_each(|taxel| curve_sigmas_kpa[taxel] = repeatability_kpa.hypot(self.at_rest_kpa(taxel)));
        curve_sigmas_kpa
    }

    /// What a taxel reads too much or too little at its own zero, kPa, not negative; 0 where that was never measured, or where
    /// the live force reads a straight line from the zero to the curve (`force/light_end.rs`).
    fn at_rest_kpa(&self, taxel: usize) -> f64 {
        let Some(zero) = self.baseline.get(taxel).map(|rest| rest.mean).filter(|zero| zero.is_finite()) else {
            return 0.0;
        };
        let model = &self.taxels[taxel];
        let Some(Reading { kpa, range, .. }) = model.evaluate(zero) else { return 0.0 };
        let before = range.in_pressure(model.sign) == RangeState::Below;
        if before && kpa > 0.0 { 0.0 } else { kpa.abs() }
    }
}
