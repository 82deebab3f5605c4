//! The standard deviation of one reading's pressure, as a profile over the counts.

use serde::{Deserialize, Serialize};

/// Most intervals between knots.
pub(crate) const MAX_KNOTS: f64 = 1024.0;

/// Most knots of a profile.
pub const KNOTS_MAX: usize = MAX_KNOTS as usize + 1;

/// Standard deviation at equally spaced counts, linear between them, constant beyond.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SigmaProfile {
    /// Count of the first knot.
    pub first_count: f64,
    /// Counts from knot to knot.
    pub step_counts: f64,
    /// Standard deviation of one reading at each knot, kPa, quantisation included.
    pub sigma_kpa: Vec<f64>,
}

impl SigmaProfile {
    /// The standard deviation of one reading at `count`, kPa; infinite for an empty profile.
    #[must_use]
    pub fn at(&self, count: f64) -> f64 {
        between_knots((count - self.first_count) / self.step_counts, &self.sigma_kpa)
    }
}

/// On a straight line between the values at the numbers beside `place`, held beyond the ends; infinite without values.
pub(crate) fn between_knots(place: f64, values: &[f64]) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::INFINITY };
    let place = place.clamp(0.0, last as f64);
    let k = (place as usize).min(last.saturating_sub(1));
    let part = place - k as f64;
    // Not a + part (b - a): beside a knot of 1e20 kPa that would read 0 at one of 1 kPa.
    (1.0 - part) * values[k] + part * values[(k + 1).min(last)]
}

/// 97.5 % quantile of Student's distribution, for two-sided 95 % intervals.
///
/// Cornish-Fisher expansion in 1 / dof (Abramowitz and Stegun 26.7.5), within 1 % from three degrees of freedom on;
/// exact values for one and two.
#[must_use]
pub fn student_975(dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 {
        return f64::INFINITY;
    }
    if dof < 1.5 {
        return 12.706_204_736;
    }
    if dof < 2.5 {
        return 4.302_652_730;
    }
    let z = 1.959_963_985_f64;
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * dof)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * dof.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * dof.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FitOptions, Samples, fit};

    /// Found by `no_samples_and_no_options_break_a_fit`, one time in 7000.
    #[test]
    fn counts_of_almost_no_width_have_a_profile() {
        let near_nothing = 5e-324; // The smallest number above 0: a 64th of it is 0.
        for (low, high) in [(0.0, near_nothing), (-1e308, 1e308)] {
            let counts: Vec<f64> = (0..400).map(|k| if k % 2 == 0 { low } else { high }).collect();
            let kpa: Vec<f64> = (0..400).map(|k| f64::from(k % 2) * 20.0 + f64::from(k % 7)).collect();
            let options = FitOptions { order: 1, ..FitOptions::default() };
            assert_eq!(fit(&Samples::new(&counts, &kpa), &options).validate(), Ok(()), "{low} to {high}");
        }
    }

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        for (dof, want) in [(1.0, 12.706), (2.0, 4.303), (3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (100.0, 1.984)] {
            assert!((student_975(dof) / want - 1.0).abs() < 0.01, "{dof}: {}", student_975(dof));
        }
        assert_eq!(student_975(0.0), f64::INFINITY);
    }

    #[test]
    fn a_knot_beside_a_great_one_keeps_its_deviation() {
        let profile = SigmaProfile { first_count: 0.0, step_counts: 1.0, sigma_kpa: vec![1e300, 2.0] };
        assert_eq!(profile.at(1.0), 2.0);
        assert_eq!(SigmaProfile { sigma_kpa: vec![2.0, 1e300], ..profile }.at(0.0), 2.0);
    }

    #[test]
    fn three_samples_on_a_line_are_no_proof_that_it_has_no_error() {
        let options = FitOptions { order: 1, ..FitOptions::default() };
        let model = fit(&Samples::new(&[4.5, 10.0, 4.5], &[57.0, 0.0, 57.0]), &options);
        let reading = model.evaluate(4.5).unwrap();
        assert!(reading.sigma_kpa > 0.0, "{reading:?}");
    }

    #[test]
    fn a_profile_is_linear_between_knots_and_constant_beyond() {
        let profile = SigmaProfile { first_count: 10.0, step_counts: 2.0, sigma_kpa: vec![1.0, 3.0, 2.0] };
        for (count, want) in [(0.0, 1.0), (10.0, 1.0), (11.0, 2.0), (13.0, 2.5), (14.0, 2.0), (99.0, 2.0)] {
            assert_eq!(profile.at(count), want, "{count}");
        }
    }
}
