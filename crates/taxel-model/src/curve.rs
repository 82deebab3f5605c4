//! A taxel's curve in the form it is served in.

use serde::{Deserialize, Serialize};

/// Places of a range at which the slope of a curve is looked at, eight and more a count of a converter of 8 bits.
const SLOPES: u32 = 2_048;

/// A slope of this share of the steepest that the coefficients allow is rounding.
const SLOPE_ROUNDING: f64 = 1e-13;

/// P(C) = sum c_k T_k(s), s = (C - centre) / half_width, in kPa.
///
/// T_k are the Chebyshev polynomials. In this form rounding a coefficient changes the pressure by no more than that
/// rounding; in powers of the raw count it can change it by hundreds of pascal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Count at s = 0; an integer where the range is 4 counts and more, so that C - centre is exact.
    pub centre: f64,
    /// Counts from the centre to the farther end of the range; positive.
    pub half_width: f64,
    /// Coefficients of T_0, T_1, ... in kPa; 1 to 11 of them.
    pub chebyshev: Vec<f64>,
}

impl Curve {
    /// Centre and half-width for the range `low..high`.
    pub(crate) fn frame(low: f64, high: f64) -> (f64, f64) {
        let middle = low + (high - low) / 2.0;
        let centre = if high - low >= 4.0 { middle.round() } else { middle };
        let half = (high - centre).max(centre - low);
        (centre, if half > 0.0 { half } else { 1.0 })
    }

    /// The pressure at `count`, kPa, by Clenshaw's rule; also outside the range, where it means nothing.
    #[must_use]
    pub fn evaluate(&self, count: f64) -> f64 {
        let Some((first, rest)) = self.chebyshev.split_first() else { return 0.0 };
        let s = (count - self.centre) / self.half_width;
        let (mut b1, mut b2) = (0.0, 0.0);
        for c in rest.iter().rev() {
            (b1, b2) = (2.0 * s * b1 - b2 + c, b1);
        }
        s * b1 - b2 + first
    }

    /// The slope at `count`, kPa per count: P' = sum k c_k U_{k-1}(s) / half_width.
    #[must_use]
    pub fn slope(&self, count: f64) -> f64 {
        let s = (count - self.centre) / self.half_width;
        let (mut u_last, mut u) = (0.0, 1.0);
        let mut sum = 0.0;
        for (k, c) in self.chebyshev.iter().enumerate().skip(1) {
            sum += k as f64 * c * u;
            (u_last, u) = (u, 2.0 * s * u - u_last);
        }
        sum / self.half_width
    }

    /// A count in `range` where the slope has not the sign `sign`, if there is one.
    pub(crate) fn wrong_slope(&self, [low, high]: [f64; 2], sign: f64) -> Option<f64> {
        // |T_k'| is k^2 at most.
        let steepest: f64 = self.chebyshev.iter().enumerate().map(|(k, c)| (k * k) as f64 * c.abs()).sum();
        let least = -SLOPE_ROUNDING * steepest / self.half_width;
        let mut counts = (0..=SLOPES).map(|k| low + (high - low) * (f64::from(k) / f64::from(SLOPES)));
        counts.find(|count| {
            let slope = sign * self.slope(*count);
            slope.is_nan() || slope < least
        })
    }

    /// The order of the polynomial.
    #[must_use]
    pub fn order(&self) -> usize {
        self.chebyshev.len().saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn value_and_slope_of_a_cubic() {
        // 4 s^3 - 3 s = T_3 with s = (C - 200) / 32.
        let curve = Curve { centre: 200.0, half_width: 32.0, chebyshev: vec![0.0, 0.0, 0.0, 1.0] };
        assert_eq!(curve.evaluate(216.0), -1.0);
        assert_eq!(curve.slope(216.0), (12.0 * 0.25 - 3.0) / 32.0);
        assert_eq!(curve.slope(232.0), 9.0 / 32.0);
    }

    #[test]
    fn a_cubic_with_a_dent_is_told_from_one_without() {
        // T_1 / 100 + (T_3 + 3 T_1) / 4, of which s^3 is the last part.
        let cubic =
            |slope: f64| Curve { centre: 200.0, half_width: 50.0, chebyshev: vec![0.0, slope + 0.75, 0.0, 0.25] };
        assert_eq!(cubic(0.01).wrong_slope([150.0, 250.0], 1.0), None);
        assert_eq!(cubic(0.01).wrong_slope([150.0, 250.0], -1.0), Some(150.0));
        let dent = cubic(-0.01).wrong_slope([150.0, 250.0], 1.0).unwrap();
        assert!((dent - 200.0).abs() < 3.0, "{dent}");
        assert_eq!(cubic(-0.01).wrong_slope([150.0, 196.0], 1.0), None, "the dent begins at 197");
        assert!(cubic(f64::NAN).wrong_slope([150.0, 250.0], 1.0).is_some());
    }

    proptest! {
        #[test]
        fn what_is_told_of_a_curve_agrees_with_its_pressures(
            c in proptest::collection::vec(-1.0..1.0_f64, 2..10), lift in 0.0..30.0_f64,
        ) {
            let mut curve = Curve { centre: 0.0, half_width: 1.0, chebyshev: c };
            curve.chebyshev[1] += lift;
            let rises = curve.wrong_slope([-1.0, 1.0], 1.0).is_none();
            let kpa: Vec<f64> = (0..=3_000).map(|k| curve.evaluate(f64::from(k) / 1_500.0 - 1.0)).collect();
            let least = kpa.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
            // Between the places that are looked at a slope bends by no more than this.
            prop_assert!(!rises || least >= -1e-4, "rises, but steps back by {least}");
            prop_assert!(rises || least <= 3e-3, "does not rise, but the least step is {least}");
        }
    }
}
