//! Weighted least squares in exact integers: the judge of every solver.
//!
//! Every f64 is an integer times a power of two. So moments and normal equations are integers without rounding, and
//! elimination without fractions (Bareiss 1968, "Sylvester's identity and multistep integer-preserving Gaussian
//! elimination") gives the coefficients as quotients of integers. Conditioning plays no part.

use num_bigint::{BigInt, Sign};
use num_rational::BigRational;
use std::collections::BTreeMap;

/// The least-squares polynomial, exactly: `sum over k of numerators[k] / denominator * 2^y_exponent * s^k`, with
/// s = x / 2^x_exponent - origin.
#[derive(Clone, Debug)]
pub struct Reference {
    numerators: Vec<BigInt>,
    denominator: BigInt,
    origin: BigInt,
    x_exponent: i32,
    y_exponent: i32,
}

/// Sums over all samples of one abscissa: of the weights, and of weight times value.
#[derive(Clone, Default)]
struct Group {
    weight: BigInt,
    moment: BigInt,
}

impl Reference {
    /// The polynomial of `order` that minimises the sum of w (y - p(x))^2; without weights all are 1.
    ///
    /// `None` if a number is not finite, a weight is negative, lengths differ, or the abscissae of positive weight
    /// carry no such order.
    #[must_use]
    pub fn fit(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Self> {
        let ones;
        let w = match w {
            Some(w) => w,
            None => {
                ones = vec![1.0; x.len()];
                &ones
            }
        };
        if x.len() != y.len() || w.len() != x.len() || w.iter().any(|w| *w < 0.0) {
            return None;
        }
        let ((x, x_exponent), (y, y_exponent), (w, _)) = (integers(x)?, integers(y)?, integers(w)?);
        let rows = x.into_iter().zip(w.into_iter().zip(&y).map(|(w, y)| (&w * y, w)));
        Self::orders(rows, (x_exponent, y_exponent), order).into_iter().nth(order)
    }

    /// From rows of abscissa, weight times value, and weight, in units of two to the exponents of x and y.
    fn orders(
        rows: impl Iterator<Item = (BigInt, (BigInt, BigInt))>,
        exponents: (i32, i32),
        order: usize,
    ) -> Vec<Self> {
        let mut groups: BTreeMap<BigInt, Group> = BTreeMap::new();
        for (x, (moment, weight)) in rows.filter(|row| row.1.1.sign() == Sign::Plus) {
            let group = groups.entry(x).or_default();
            group.moment += moment;
            group.weight += weight;
        }
        let (Some((first, _)), Some((last, _))) = (groups.first_key_value(), groups.last_key_value()) else {
            return Vec::new();
        };
        // About the middle, and without zeros that all have at their end, so that the powers stay short.
        let zeros = groups.keys().filter_map(BigInt::trailing_zeros).min().unwrap_or(0);
        let origin = (first + last) >> (zeros + 1);
        let rows = groups.iter().map(|(x, group)| ((x >> zeros) - &origin, group));
        let solution = |(numerators, denominator)| Self {
            numerators,
            denominator,
            origin: origin.clone(),
            x_exponent: exponents.0 + zeros as i32,
            y_exponent: exponents.1,
        };
        solve(normal_equations(rows, order)).into_iter().map(solution).collect()
    }

    /// The value at `x`, correctly rounded; NaN if `x` is not finite.
    #[must_use]
    pub fn evaluate(&self, x: f64) -> f64 {
        let Some((mantissa, exponent)) = dyadic(x) else { return f64::NAN };
        // s as an integer times 2^-below.
        let below = if mantissa == 0 { 0 } else { (self.x_exponent - exponent).max(0) } as u64;
        let above = if mantissa == 0 { 0 } else { (exponent - self.x_exponent).max(0) } as u64;
        let s = (BigInt::from(mantissa) << above) - (&self.origin << below);
        let order = self.numerators.len() - 1;
        let mut sum = BigInt::ZERO;
        for (k, numerator) in self.numerators.iter().enumerate().rev() {
            sum = sum * &s + (numerator << (below * (order - k) as u64));
        }
        round(&sum, &self.denominator, i64::from(self.y_exponent) - (below * order as u64) as i64)
    }

    /// Coefficients in ascending powers of the raw abscissa, exactly.
    #[must_use]
    pub fn coefficients(&self) -> Vec<BigRational> {
        let rational = |n: &BigInt| BigRational::new(n.clone(), self.denominator.clone());
        let mut coefficients: Vec<BigRational> = self.numerators.iter().map(rational).collect();
        // From powers of s + origin to powers of s: Horner's scheme shifts by one root at a time.
        let origin = BigRational::from_integer(self.origin.clone());
        for first in 0..coefficients.len() {
            for k in (first..coefficients.len() - 1).rev() {
                let carried = &coefficients[k + 1] * &origin;
                coefficients[k] -= carried;
            }
        }
        let two = integer(2);
        let scale = |(k, c): (usize, BigRational)| c * two.pow(self.y_exponent - k as i32 * self.x_exponent);
        coefficients.into_iter().enumerate().map(scale).collect()
    }
}

/// The coefficients, ascending, of the polynomial of `order` that minimises the sum of (y - p(x))^2; `None` if the
/// abscissae carry no such order or lengths differ.
#[must_use]
pub fn least_squares(x: &[BigRational], y: &[BigRational], order: usize) -> Option<Vec<BigRational>> {
    // All in one unit, the least common multiple of the denominators, they are integers.
    let unit = |values: &[BigRational]| {
        values.iter().fold(BigInt::from(1), |unit, v| v.denom() * BigRational::new(v.denom().clone(), unit).denom())
    };
    let (x_unit, y_unit) = (BigRational::from_integer(unit(x)), BigRational::from_integer(unit(y)));
    let rows =
        x.iter().zip(y).map(|(x, y)| ((x * &x_unit).to_integer(), ((y * &y_unit).to_integer(), BigInt::from(1))));
    let fit = Reference::orders(rows, (0, 0), order).into_iter().nth(order).filter(|_| x.len() == y.len())?;
    let scaled = |(k, c): (usize, BigRational)| c * x_unit.pow(k as i32) / &y_unit;
    Some(fit.coefficients().into_iter().enumerate().map(scaled).collect())
}

/// An integer as a rational number.
#[must_use]
pub fn integer(value: i64) -> BigRational {
    BigRational::from_integer(BigInt::from(value))
}

/// A decimal number such as `-12.5e-3` as a rational one; `None` if it is none.
#[must_use]
pub fn decimal(text: &str) -> Option<BigRational> {
    let (mantissa, exponent) = match text.trim().split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse().ok()?),
        None => (text.trim(), 0),
    };
    let places = mantissa.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    let digits: BigInt = mantissa.replacen('.', "", 1).parse().ok()?;
    Some(BigRational::from_integer(digits) * integer(10).pow(exponent - i32::try_from(places).ok()?))
}

/// Correct digits of the worst coefficient (log relative error), 0 to 16: an f64 holds no more. `None` if one is not
/// finite or their numbers differ.
#[must_use]
pub fn correct_digits(got: &[f64], want: &[BigRational]) -> Option<f64> {
    let digits = got.iter().zip(want).map(|(got, want)| {
        let error = exact(*got)? - want;
        let error = to_f64(&if *want == integer(0) { error } else { error / want }).abs();
        Some((-error.log10()).clamp(0.0, 16.0))
    });
    digits.collect::<Option<Vec<f64>>>().filter(|_| got.len() == want.len())?.into_iter().reduce(f64::min)
}

/// A rational number as the nearest f64, ties to even; infinite beyond the range of f64.
#[must_use]
pub fn to_f64(value: &BigRational) -> f64 {
    round(value.numer(), value.denom(), 0)
}

/// An f64 as a rational number without rounding; `None` if it is not finite.
#[must_use]
pub fn exact(value: f64) -> Option<BigRational> {
    BigRational::from_float(value)
}

/// `value` is mantissa * 2^exponent with an odd mantissa, or 0.
fn dyadic(value: f64) -> Option<(i64, i32)> {
    if !value.is_finite() {
        return None;
    }
    let bits = value.to_bits();
    let (fraction, exponent) = ((bits & ((1 << 52) - 1)) as i64, ((bits >> 52) & 0x7ff) as i32);
    let (mantissa, exponent) = if exponent == 0 { (fraction, -1074) } else { (fraction | 1 << 52, exponent - 1075) };
    if mantissa == 0 {
        return Some((0, 0));
    }
    let zeros = mantissa.trailing_zeros();
    let mantissa = mantissa >> zeros;
    Some((if value < 0.0 { -mantissa } else { mantissa }, exponent + zeros as i32))
}

/// The values as integers times one power of two; `None` if one is not finite.
fn integers(values: &[f64]) -> Option<(Vec<BigInt>, i32)> {
    let parts: Vec<(i64, i32)> = values.iter().map(|value| dyadic(*value)).collect::<Option<_>>()?;
    let least = parts.iter().filter(|(mantissa, _)| *mantissa != 0).map(|(_, exponent)| *exponent).min().unwrap_or(0);
    let integer = |&(mantissa, exponent): &(i64, i32)| BigInt::from(mantissa) << (exponent - least).max(0) as u32;
    Some((parts.iter().map(integer).collect(), least))
}

/// The matrix of moments of rows of s and their sums, with the right side as its last column.
fn normal_equations<'a>(rows: impl Iterator<Item = (BigInt, &'a Group)>, order: usize) -> Vec<Vec<BigInt>> {
    let mut moments = vec![BigInt::ZERO; 2 * order + 1];
    let mut right = vec![BigInt::ZERO; order + 1];
    for (s, group) in rows {
        let (mut weight, mut moment) = (group.weight.clone(), group.moment.clone());
        for (k, sum) in moments.iter_mut().enumerate() {
            *sum += &weight;
            weight *= &s;
            if let Some(right) = right.get_mut(k) {
                *right += &moment;
                moment *= &s;
            }
        }
    }
    right
        .into_iter()
        .enumerate()
        .map(|(i, right)| moments[i..=i + order].iter().cloned().chain([right]).collect())
        .collect()
}

/// Solves the leading systems of every size, up to the first that is singular: numerators of the unknowns and their
/// common denominator. The matrix is a Gram matrix: where a pivot vanishes, no larger system has a solution.
fn solve(mut a: Vec<Vec<BigInt>>) -> Vec<(Vec<BigInt>, BigInt)> {
    let n = a.len();
    let mut last_pivot = BigInt::from(1);
    let mut solutions = Vec::new();
    for k in 0..n {
        if a[k][k] == BigInt::ZERO {
            break;
        }
        let pivot_row = a[k].clone();
        for row in &mut a[k + 1..] {
            let factor = row[k].clone();
            for j in k + 1..=n {
                // Divides without remainder: that is Sylvester's identity.
                row[j] = (&row[j] * &pivot_row[k] - &factor * &pivot_row[j]) / &last_pivot;
            }
            row[k] = BigInt::ZERO;
        }
        // The triangle down to here is that of the system of this size, too.
        let denominator = pivot_row[k].clone();
        let mut numerators = vec![BigInt::ZERO; k + 1];
        for i in (0..=k).rev() {
            let known: BigInt = (i + 1..=k).map(|j| &a[i][j] * &numerators[j]).sum();
            numerators[i] = (&denominator * &a[i][n] - known) / &a[i][i];
        }
        solutions.push((numerators, denominator.clone()));
        last_pivot = denominator;
    }
    solutions
}

/// numerator / denominator * 2^exponent as the nearest f64, ties to even; infinite beyond the range of f64.
fn round(numerator: &BigInt, denominator: &BigInt, exponent: i64) -> f64 {
    if numerator.sign() == Sign::NoSign {
        return 0.0;
    }
    let negative = numerator.sign() != denominator.sign();
    let (n, d) = (numerator.magnitude(), denominator.magnitude());
    // The quotient gets 64 or 65 bits, but none below half the least denormal, so that it is rounded once.
    let wanted = 64 - (n.bits() as i64 - d.bits() as i64);
    let shift = wanted.min(1076 + exponent);
    let (n, d) = if shift >= 0 { (n << shift as u64, d.clone()) } else { (n.clone(), d << (-shift) as u64) };
    let (quotient, rest) = (&n / &d, &n % &d);
    let digits = quotient.to_u64_digits();
    let low = digits.first().copied().unwrap_or(0);
    let quotient = u128::from(low) | digits.get(1).map_or(0, |high| u128::from(*high) << 64);
    // One more bit stands for all that follows.
    let sticky = quotient << 1 | u128::from(rest.bits() > 0);
    let value = scale(sticky, exponent - shift - 1);
    if negative { -value } else { value }
}

/// value * 2^exponent, rounded to the nearest f64, ties to even.
fn scale(value: u128, exponent: i64) -> f64 {
    let bits = i64::from(128 - value.leading_zeros());
    // The place of the last bit that an f64 of this size has.
    let last = (bits + exponent - 53).max(-1074);
    let drop = last - exponent;
    if drop <= 0 {
        return power_of_two_times(value as f64, exponent);
    }
    if drop > 127 {
        return 0.0;
    }
    let (kept, rest, half) = (value >> drop, value & ((1 << drop) - 1), 1_u128 << (drop - 1));
    let up = rest > half || (rest == half && kept & 1 == 1);
    power_of_two_times((kept + u128::from(up)) as f64, last)
}

/// value * 2^exponent for a value of at most 53 bits whose last bit the result can hold: every step is exact.
fn power_of_two_times(value: f64, exponent: i64) -> f64 {
    let half = exponent.clamp(-2200, 2200) as i32 / 2;
    let power = |e: i32| 2.0_f64.powi(e.clamp(-1022, 1023));
    let rest = exponent.clamp(-2200, 2200) as i32 - half;
    value * power(half) * power(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    use proptest::prelude::*;

    fn value(coefficients: &[BigRational], x: &BigRational) -> BigRational {
        coefficients.iter().rev().fold(integer(0), |sum, c| sum * x + c)
    }

    #[test]
    fn an_exact_cubic_is_found_again() {
        let x: Vec<f64> = (-20..20).map(|k| 16_777_216.0 + f64::from(k) / 8.0).collect();
        let y: Vec<f64> = x.iter().map(|x| (x - 16_777_216.0).powi(3) - 0.5).collect();
        let fit = Reference::fit(&x, &y, None, 3).unwrap();
        assert!(x.iter().zip(&y).all(|(x, y)| fit.evaluate(*x) == *y));
        assert_eq!(to_f64(&fit.coefficients()[3]), 1.0);
        assert_eq!(to_f64(&fit.coefficients()[2]), -3.0 * 16_777_216.0);
    }

    #[test]
    fn what_has_no_solution_is_none() {
        assert!(Reference::fit(&[], &[], None, 0).is_none());
        assert!(Reference::fit(&[1.0, 1.0, 2.0], &[1.0; 3], None, 2).is_none());
        assert!(Reference::fit(&[1.0, 2.0, 3.0], &[1.0; 3], Some(&[1.0, 0.0, 1.0]), 2).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0, f64::NAN], None, 1).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0, 2.0], Some(&[1.0, -1.0]), 1).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0], None, 1).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0, 2.0], None, 1).unwrap().evaluate(f64::INFINITY).is_nan());
    }

    #[test]
    fn denormal_and_huge_values_are_no_special_case() {
        for scale in [f64::from_bits(1), 1e-310, 2.0_f64.powi(1000)] {
            let y = [0.0, 3.0 * scale, 6.0 * scale, 9.0 * scale];
            let fit = Reference::fit(&[1.0, 2.0, 3.0, 4.0], &y, None, 1).unwrap();
            assert_eq!((fit.evaluate(3.0), fit.evaluate(1.0)), (6.0 * scale, 0.0));
        }
    }

    #[test]
    fn decimals_are_exact_and_their_polynomials_too() {
        let rational = |n: i64, d: i64| integer(n) / integer(d);
        assert_eq!(decimal(" -12.345 "), Some(rational(-12_345, 1000)));
        assert_eq!(decimal("-0.5E-1"), Some(rational(-1, 20)));
        assert!(decimal("1.2.3").is_none() && decimal("").is_none() && decimal("1e").is_none());
        let x = ["0.1", "0.2", "0.35", "7"].map(|text| decimal(text).unwrap());
        let y: Vec<BigRational> = x.iter().map(|x| rational(1, 3) + rational(2, 7) * x).collect();
        assert_eq!(least_squares(&x, &y, 1).unwrap(), [rational(1, 3), rational(2, 7)]);
        assert!(least_squares(&x, &y, 4).is_none() && least_squares(&x, &y[..3], 1).is_none());
    }

    #[test]
    fn digits_of_the_worst_coefficient() {
        let exact = [integer(1), integer(3)];
        assert_eq!(correct_digits(&[1.0, 3.0], &exact), Some(16.0));
        let digits = correct_digits(&[1.0, 3.003], &exact).unwrap();
        assert!((digits - 3.0).abs() < 1e-3, "{digits}");
        assert_eq!(correct_digits(&[1.0, -1e9], &exact), Some(0.0));
        assert!(correct_digits(&[1.0], &exact).is_none() && correct_digits(&[f64::NAN, 3.0], &exact).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// The processor divides correctly rounded too, down to denormals.
        #[test]
        fn quotients_are_rounded_as_ieee_754_rounds_them(
            a in NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE, b in NORMAL | SUBNORMAL | POSITIVE | NEGATIVE,
        ) {
            prop_assert_eq!(to_f64(&(exact(a).unwrap() / exact(b).unwrap())), a / b + 0.0);
        }

        /// What defines least squares: the residuals are orthogonal to every power. Exactly.
        #[test]
        fn the_residuals_are_orthogonal_to_the_powers(
            rows in proptest::collection::vec((-40_i32..40, -1e6..1e6_f64, 0_u8..4), 4..24),
            order in 0_usize..5, offset in -1e7..1e7_f64,
        ) {
            let x: Vec<f64> = rows.iter().map(|row| offset + f64::from(row.0) / 4.0).collect();
            let y: Vec<f64> = rows.iter().map(|row| row.1).collect();
            let w: Vec<f64> = rows.iter().map(|row| f64::from(row.2)).collect();
            let Some(fit) = Reference::fit(&x, &y, Some(&w), order) else { return Ok(()) };
            let coefficients = fit.coefficients();
            for power in 0..=order as i32 {
                let sum = x.iter().zip(&y).zip(&w).fold(integer(0), |sum, ((x, y), w)| {
                    let x = exact(*x).unwrap();
                    let residual = exact(*y).unwrap() - value(&coefficients, &x);
                    sum + exact(*w).unwrap() * residual * x.pow(power)
                });
                prop_assert_eq!(sum, integer(0));
            }
            for at in [x[0], 0.0, 1.5, 1e9] {
                prop_assert_eq!(fit.evaluate(at), to_f64(&value(&coefficients, &exact(at).unwrap())));
            }
        }
    }
}
