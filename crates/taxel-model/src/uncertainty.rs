//! The standard deviation of one reading's pressure, as a profile over the counts.
//!
//! var(C) = v(C) + s^2 h(C). v is the mean square of the residuals at and next to the count, shrunk towards the pooled
//! s^2 where samples are few: skin is noisier, in kPa, where it is flat, and a pooled value alone covers only four
//! of five readings there. h is the leverage of a new sample. What gauge and area share among taxels is not in it.

use crate::bounded;
use crate::curve::Curve;
use crate::orthogonal::Basis;
use serde::{Deserialize, Serialize};

/// Samples that the pooled variance counts for.
const PRIOR_SAMPLES: f64 = 8.0;

/// Knots over a range of real counts, or of more than this many integer ones.
const REAL_KNOTS: usize = 64;
const MAX_KNOTS: f64 = 1024.0;

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
    #[serde(deserialize_with = "bounded::list::<_, _, KNOTS_MAX>")]
    pub sigma_kpa: Vec<f64>,
}

impl SigmaProfile {
    /// The standard deviation of one reading at `count`, kPa; infinite for an empty profile.
    #[must_use]
    pub fn at(&self, count: f64) -> f64 {
        let Some(last) = self.sigma_kpa.len().checked_sub(1) else { return f64::INFINITY };
        let place = ((count - self.first_count) / self.step_counts).clamp(0.0, last as f64);
        let k = (place as usize).min(last.saturating_sub(1));
        let part = place - k as f64;
        let next = self.sigma_kpa[(k + 1).min(last)];
        // Not a + part (b - a): beside a knot of 1e20 kPa that would read 0 at one of 1 kPa.
        (1.0 - part) * self.sigma_kpa[k] + part * next
    }
}

/// Residual statistics at one count: samples, and the sum of squared residuals about the served curve, kPa^2.
pub(crate) struct Scatter {
    pub count: f64,
    pub n: f64,
    pub squares: f64,
}

/// What a profile is made from.
pub(crate) struct Evidence<'a> {
    pub scatter: &'a [Scatter],
    pub range: [f64; 2],
    /// Counts are integers: one knot each, and quantisation is a floor.
    pub integer: bool,
    /// Samples less coefficients.
    pub dof: f64,
    pub basis: &'a Basis,
    /// Coefficients in the basis.
    pub d: &'a [f64],
    pub order: usize,
    /// The variable of the basis is (count - `curve.centre`) / `scale`.
    pub scale: f64,
    /// The served curve.
    pub curve: &'a Curve,
}

/// A profile, and how many samples support each knot.
pub(crate) fn profile(evidence: &Evidence<'_>) -> Option<(SigmaProfile, Vec<f64>)> {
    if evidence.dof <= 0.0 {
        return None;
    }
    let [low, high] = evidence.range;
    let by_count = evidence.integer && high - low < MAX_KNOTS;
    let intervals = if by_count { (high - low).max(0.0) as usize } else { REAL_KNOTS };
    // Counts as near as the smallest numbers, or as far apart as the greatest, have no width to divide.
    let width = (high - low) / REAL_KNOTS as f64;
    let step = if !by_count && width.is_normal() { width } else { 1.0 };
    let knot = |count: f64| (((count - low) / step).clamp(0.0, intervals as f64) + 0.5) as usize;
    // A knot more at each end, so that every one has two neighbours.
    let (mut n, mut squares) = (vec![0.0; intervals + 3], vec![0.0; intervals + 3]);
    for code in evidence.scatter {
        let at = knot(code.count) + 1;
        n[at] += code.n;
        squares[at] += code.squares;
    }
    let samples: f64 = n.iter().sum();
    let pooled = squares.iter().sum::<f64>() / evidence.dof;
    let counts: Vec<f64> = (0..=intervals).map(|k| low + k as f64 * step).collect();
    let t: Vec<f64> = counts.iter().map(|count| (count - evidence.curve.centre) / evidence.scale).collect();
    let leverages = evidence.basis.leverages(&t, evidence.order);
    let windows = n.windows(3).zip(squares.windows(3));
    // Samples that a curve meets exactly say nothing of its error, but it was computed in doubles.
    let rounding = f64::EPSILON * evidence.curve.chebyshev.iter().map(|c| c.abs()).sum::<f64>();
    let sigma_kpa = windows
        .zip(counts.iter().zip(&leverages))
        .map(|((n, squares), (count, (leverage, last)))| {
            let near = n[0] + n[1] + n[2];
            let sum = (squares[0] + squares[1] + squares[2]) * samples / evidence.dof;
            let local = (sum + PRIOR_SAMPLES * pooled) / (near + PRIOR_SAMPLES);
            let quantum = if evidence.integer { evidence.curve.slope(*count).powi(2) / 12.0 } else { 0.0 };
            // Where no sample vouches for the curve, the step from the next lower order stands for its error.
            let unseen = if near > 0.0 { 0.0 } else { evidence.d[evidence.order] * last };
            // Quantisation is in the residuals of integer counts already: it is a floor, not a term. Far from all
            // samples a basis overflows: the deviation stays a number that files can hold.
            (local.max(quantum) + pooled * leverage + unseen * unseen).sqrt().max(rounding).min(f64::MAX)
        })
        .collect();
    let support = n[1..=intervals + 1].to_vec();
    Some((SigmaProfile { first_count: low, step_counts: step, sigma_kpa }, support))
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
