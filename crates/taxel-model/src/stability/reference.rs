//! Least squares in exact integers: the judge of every solver.
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

/// All samples of one abscissa: how many, and the sum of their values.
#[derive(Clone, Default)]
struct Group {
    count: BigInt,
    sum: BigInt,
}

impl Reference {
    /// The polynomial of `order` that minimises the sum of (y - p(x))^2.
    ///
    /// `None` if a number is not finite, lengths differ, or the abscissae carry no such order.
    #[must_use]
    pub fn fit(x: &[f64], y: &[f64], order: usize) -> Option<Self> {
        if x.len() != y.len() {
            return None;
        }
        let ((x, x_exponent), (y, y_exponent)) = (integers(x)?, integers(y)?);
        let mut groups: BTreeMap<BigInt, Group> = BTreeMap::new();
        for (x, y) in x.into_iter().zip(y) {
            let group = groups.entry(x).or_default();
            group.count += 1;
            group.sum += y;
        }
        let ((first, _), (last, _)) = (groups.first_key_value()?, groups.last_key_value()?);
        // About the middle, and without zeros that all have at their end, so that the powers stay short.
        let zeros = groups.keys().filter_map(BigInt::trailing_zeros).min().unwrap_or(0);
        let origin = (first + last) >> (zeros + 1);
        let rows = groups.iter().map(|(x, group)| ((x >> zeros) - &origin, group));
        let (numerators, denominator) = solve(normal_equations(rows, order))?;
        Some(Self { numerators, denominator, origin, x_exponent: x_exponent + zeros as i32, y_exponent })
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
        let two = BigRational::from_integer(BigInt::from(2));
        let scale = |(k, c): (usize, BigRational)| c * two.pow(self.y_exponent - k as i32 * self.x_exponent);
        coefficients.into_iter().enumerate().map(scale).collect()
    }
}

/// A rational number as the nearest f64, ties to even; infinite beyond the range of f64.
#[must_use]
pub fn to_f64(value: &BigRational) -> f64 {
    round(value.numer(), value.denom(), 0)
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
        let (mut count, mut moment) = (group.count.clone(), group.sum.clone());
        for (k, sum) in moments.iter_mut().enumerate() {
            *sum += &count;
            count *= &s;
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

/// Solves the system: numerators of the unknowns and their common denominator; `None` if it is singular. The matrix is a
/// Gram matrix, so that no pivot vanishes otherwise.
fn solve(mut a: Vec<Vec<BigInt>>) -> Option<(Vec<BigInt>, BigInt)> {
    let n = a.len();
    let mut last_pivot = BigInt::from(1);
    for k in 0..n {
        if a[k][k] == BigInt::ZERO {
            return None;
        }
        let pivot_row = a[k].clone();
        for row in &mut a[k + 1..] {
            let factor = row[k].clone();
            for j in k + 1..=n {
                // Divides without remainder: that is Sylvester's identity.
                row[j] = (&row[j] * &pivot_row[k] - &factor * &pivot_row[j]) / &last_pivot;
            }
        }
        last_pivot.clone_from(&pivot_row[k]);
    }
    let mut numerators = vec![BigInt::ZERO; n];
    for i in (0..n).rev() {
        let known: BigInt = (i + 1..n).map(|j| &a[i][j] * &numerators[j]).sum();
        numerators[i] = (&last_pivot * &a[i][n] - known) / &a[i][i];
    }
    Some((numerators, last_pivot))
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

    fn exact(value: f64) -> BigRational {
        BigRational::from_float(value).unwrap()
    }

    fn value(coefficients: &[BigRational], x: &BigRational) -> BigRational {
        coefficients.iter().rev().fold(exact(0.0), |sum, c| sum * x + c)
    }

    #[test]
    fn what_has_no_solution_is_none() {
        assert!(Reference::fit(&[], &[], 0).is_none());
        assert!(Reference::fit(&[1.0, 1.0, 2.0], &[1.0; 3], 2).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0, f64::NAN], 1).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0], 1).is_none());
        assert!(Reference::fit(&[1.0, 2.0], &[1.0, 2.0], 1).unwrap().evaluate(f64::INFINITY).is_nan());
    }

    #[test]
    fn denormal_and_huge_values_are_no_special_case() {
        for scale in [f64::from_bits(1), 1e-310, 2.0_f64.powi(1000)] {
            let y = [0.0, 3.0 * scale, 6.0 * scale, 9.0 * scale];
            let fit = Reference::fit(&[1.0, 2.0, 3.0, 4.0], &y, 1).unwrap();
            assert_eq!((fit.evaluate(3.0), fit.evaluate(1.0)), (6.0 * scale, 0.0));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// The processor divides correctly rounded too, down to denormals.
        #[test]
        fn quotients_are_rounded_as_ieee_754_rounds_them(
            a in NORMAL | SUBNORMAL | ZERO | POSITIVE | NEGATIVE, b in NORMAL | SUBNORMAL | POSITIVE | NEGATIVE,
        ) {
            prop_assert_eq!(to_f64(&(exact(a) / exact(b))), a / b + 0.0);
        }

        /// What defines least squares: the residuals are orthogonal to every power. Exactly.
        #[test]
        fn the_residuals_are_orthogonal_to_the_powers(
            rows in proptest::collection::vec((-40_i32..40, -1e6..1e6_f64), 4..24),
            order in 0_usize..5, offset in -1e7..1e7_f64,
        ) {
            let x: Vec<f64> = rows.iter().map(|row| offset + f64::from(row.0) / 4.0).collect();
            let y: Vec<f64> = rows.iter().map(|row| row.1).collect();
            let Some(fit) = Reference::fit(&x, &y, order) else { return Ok(()) };
            let coefficients = fit.coefficients();
            for power in 0..=order as i32 {
                let residual = |(x, y): (&f64, &f64)| (exact(*y) - value(&coefficients, &exact(*x))) * exact(*x).pow(power);
                prop_assert_eq!(x.iter().zip(&y).map(residual).sum::<BigRational>(), exact(0.0));
            }
            for at in [x[0], 0.0, 1.5, 1e9] {
                prop_assert_eq!(fit.evaluate(at), to_f64(&value(&coefficients, &exact(at))));
            }
        }
    }
}
