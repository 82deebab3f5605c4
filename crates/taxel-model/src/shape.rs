//! Proof that a curve is monotone on its range.

use crate::dd::Dd;
use crate::series::{Chebyshev, bernstein_of, powers_of};

/// Halvings of the interval before the proof is given up; the part left is 1e-6 of the range.
const MAX_DEPTH: u32 = 20;

/// Looks for a place between `from` and `to` (in s) where the slope has not the sign `sign`; `None` is a proof that
/// there is none, for every real s and so also between the counts.
///
/// A polynomial lies in the hull of its Bernstein coefficients: if those of the slope have one sign, so has the
/// slope. Otherwise the interval is halved (de Casteljau).
pub(crate) fn wrong_slope(series: &Chebyshev, from: Dd, to: Dd, sign: f64) -> Option<f64> {
    let bernstein = bernstein_of(&powers_of(series), from, to);
    let slope: Vec<f64> = bernstein.windows(2).map(|pair| sign * (pair[1] - pair[0]).to_f64()).collect();
    let scale = slope.iter().fold(0.0, |scale: f64, s| scale.max(s.abs()));
    let place = negative_at(&slope, 1e-13 * scale, 0.0, 1.0, MAX_DEPTH)?;
    Some(from.hi + place * (to.hi - from.hi))
}

/// A place in `from..to` where a polynomial, given by its Bernstein coefficients there, may be below `-tolerance`.
fn negative_at(bernstein: &[f64], tolerance: f64, from: f64, to: f64, depth: u32) -> Option<f64> {
    if bernstein.iter().all(|b| *b >= -tolerance) {
        return None;
    }
    let (first, last) = (bernstein.first()?, bernstein.last()?);
    if *first < -tolerance || *last < -tolerance {
        return Some(if first <= last { from } else { to });
    }
    let middle = from + (to - from) / 2.0;
    if depth == 0 {
        return Some(middle);
    }
    let mut row = bernstein.to_vec();
    let (mut left, mut right) = (vec![*first], vec![*last]);
    for length in (1..row.len()).rev() {
        for i in 0..length {
            row[i] = (row[i] + row[i + 1]) / 2.0;
        }
        left.push(row[0]);
        right.push(row[length - 1]);
    }
    right.reverse();
    negative_at(&left, tolerance, from, middle, depth - 1)
        .or_else(|| negative_at(&right, tolerance, middle, to, depth - 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::chebyshev_of_powers;
    use proptest::prelude::*;

    fn series(powers: &[f64]) -> Chebyshev {
        chebyshev_of_powers(&powers.iter().copied().map(Dd::from).collect::<Vec<_>>())
    }

    #[test]
    fn a_cubic_with_a_dent_is_found_and_one_without_is_proven() {
        let (from, to) = (Dd::from(-1.0), Dd::from(1.0));
        assert_eq!(wrong_slope(&series(&[0.0, 0.01, 0.0, 1.0]), from, to, 1.0), None);
        let dent = wrong_slope(&series(&[0.0, -0.01, 0.0, 1.0]), from, to, 1.0).unwrap();
        assert!(dent.abs() < 0.06, "{dent}");
        assert!(wrong_slope(&series(&[0.0, 0.01, 0.0, 1.0]), from, to, -1.0).is_some());
    }

    proptest! {
        #[test]
        fn the_proof_agrees_with_a_fine_grid(c in proptest::collection::vec(-1.0..1.0_f64, 2..10), lift in 0.0..6.0_f64) {
            let mut powers = c.clone();
            powers[1] += lift;
            let proven = wrong_slope(&series(&powers), Dd::from(-1.0), Dd::from(1.0), 1.0).is_none();
            let slope = |x: f64| powers.iter().enumerate().skip(1).rev().fold(0.0, |s, (k, c)| s * x + k as f64 * c);
            let least = (0..=2000).map(|i| slope(f64::from(i) / 1000.0 - 1.0)).fold(f64::INFINITY, f64::min);
            // Between grid points a slope may dip by no more than its curvature allows, about 1e-4 here.
            prop_assert!(!proven || least >= -1e-9, "proven, but slope {least}");
            prop_assert!(proven || least <= 1e-3, "not proven, but slope {least}");
        }
    }
}
