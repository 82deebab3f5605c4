//! The exact solution of a taxel's least-squares problem, to about 60 digits in its making and 30 in its values.
//!
//! Pressures and counts are integers, so that the sums of a row are exact. A row's mean count is a quotient of two of
//! them; powers of it have denominators without end, therefore integers in units of 2^-256 ([`crate::reference`] is
//! exact without limit, and too slow for bins). In the scaled abscissa the normal equations of order 9 cost at most 40
//! bits of these.

use super::taxels::{Bits, Recording, UNITS_PER_KPA};
use num_bigint::BigInt;
use std::collections::BTreeMap;
use taxel_model::Dd;

/// Fraction bits.
const FRACTION: u32 = 256;

/// Bits of a coefficient's fraction that are kept: more than a double-double holds.
const KEPT: u32 = 90;

/// Which problem is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Problem {
    /// One row a sample.
    PerSample,
    /// One row a bin of pressure: mean count and mean pressure, weighted with the number of samples.
    PressureBinned,
}

/// Width of a bin of pressure in units of 2^-10 kPa: what `FitOptions::bin_width_kpa` must ask for, so that both sides
/// have the same bins.
///
/// With 8 bits two of the accumulator's own bins, whose width is 2^18 units of 2^-10 Pa, in thousandths of a unit;
/// with 16 bits half a kPa.
pub(super) fn bin_width_kpa(bits: Bits) -> f64 {
    match bits {
        Bits::Eight => 0.512,
        Bits::Sixteen => 0.5,
    }
}

fn bin(bits: Bits, units: i64) -> i64 {
    match bits {
        // 1 unit is 1000 times 2^-10 Pa.
        Bits::Eight => (units * 1000) >> 19,
        Bits::Sixteen => units.div_euclid(512),
    }
}

/// Sums over samples that make one row: number, counts, pressures in units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Row {
    pub n: i64,
    pub counts: i64,
    pub units: i64,
}

/// The rows of `problem` for taxel `taxel` of `recording`.
pub(super) fn rows(recording: &Recording, taxel: usize, problem: Problem) -> Vec<Row> {
    let mut groups: BTreeMap<i64, Row> = BTreeMap::new();
    for (units, count) in recording.units.iter().zip(&recording.taxels[taxel].counts) {
        let count = *count as i64;
        let key = match problem {
            Problem::PerSample => count,
            Problem::PressureBinned => bin(recording.bits, *units),
        };
        let row = groups.entry(key).or_default();
        row.n += 1;
        row.counts += count;
        row.units += units;
    }
    groups.into_values().collect()
}

/// The solution for one order: sum over k of c_k t^k in kPa, t = (C - centre) / scale.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    centre: f64,
    /// A power of two, so that t is exact.
    scale: f64,
    coefficients: Vec<Dd>,
}

impl Solution {
    /// The pressure at `count`, kPa.
    pub fn evaluate(&self, count: f64) -> Dd {
        let t = Dd::sum(count, -self.centre).scale_exact(1.0 / self.scale);
        self.coefficients.iter().rev().fold(Dd::ZERO, |sum, c| sum * t + *c)
    }
}

/// The solutions of orders 1 to `max_order`; those that the rows do not carry are left out at the end.
pub(super) fn solve(rows: &[Row], max_order: usize) -> Vec<Solution> {
    let mean = |row: &Row| row.counts as f64 / row.n as f64;
    let low = rows.iter().map(mean).fold(f64::INFINITY, f64::min);
    let high = rows.iter().map(mean).fold(f64::NEG_INFINITY, f64::max);
    if rows.len() < 2 || high <= low {
        return Vec::new();
    }
    let centre = ((low + high) / 2.0).round();
    let exponent = ((high - low) / 2.0).log2().ceil().clamp(0.0, 60.0) as u32;
    let (moments, right) = moments(rows, centre as i64, exponent, max_order);
    let (scale, highest) = (f64::from(exponent).exp2(), max_order.min(rows.len() - 1));
    let orders = (1..=highest).map_while(|order| {
        let system = (0..=order).map(|i| moments[i..=i + order].iter().chain([&right[i]]).cloned().collect());
        let coefficients = eliminate(system.collect())?.iter().map(to_dd).collect::<Option<Vec<Dd>>>()?;
        Some(Solution { centre, scale, coefficients })
    });
    orders.collect()
}

/// Sums of n t^k for k up to twice the order, and of the pressures times t^k, in units of 2^-FRACTION.
fn moments(rows: &[Row], centre: i64, exponent: u32, order: usize) -> (Vec<BigInt>, Vec<BigInt>) {
    let mut moments = vec![BigInt::ZERO; 2 * order + 1];
    let mut right = vec![BigInt::ZERO; order + 1];
    for row in rows {
        let t = (BigInt::from(row.counts - centre * row.n) << (FRACTION - exponent)) / row.n;
        let mut power = BigInt::from(1) << FRACTION;
        for (k, moment) in moments.iter_mut().enumerate() {
            *moment += &power * row.n;
            if let Some(right) = right.get_mut(k) {
                *right += &power * row.units;
            }
            power = (power * &t) >> FRACTION;
        }
    }
    (moments, right)
}

/// Gauss's elimination without pivots, which a Gram matrix does not need; `None` if the abscissae carry no such order.
fn eliminate(mut a: Vec<Vec<BigInt>>) -> Option<Vec<BigInt>> {
    let n = a.len();
    // A pivot as small as this is rounding.
    let nothing = BigInt::from(1) << (FRACTION / 2);
    for k in 0..n {
        if a[k][k] < nothing {
            return None;
        }
        let pivot = a[k].clone();
        for row in &mut a[k + 1..] {
            let factor = row[k].clone();
            for j in k..=n {
                row[j] -= &factor * &pivot[j] / &pivot[k];
            }
        }
    }
    let mut solution = vec![BigInt::ZERO; n];
    for i in (0..n).rev() {
        let known: BigInt = (i + 1..n).map(|j| (&a[i][j] * &solution[j]) >> FRACTION).sum();
        solution[i] = ((&a[i][n] - known) << FRACTION) / &a[i][i];
    }
    Some(solution)
}

/// From units of 2^-FRACTION of a unit of pressure to kPa.
fn to_dd(value: &BigInt) -> Option<Dd> {
    let kept = i128::try_from(value >> (FRACTION - KEPT)).ok()?;
    Some(Dd::from_i128(kept).scale_exact((-f64::from(KEPT)).exp2() / UNITS_PER_KPA as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::Reference;

    fn assert_same(rows: &[Row]) {
        let x: Vec<f64> = rows.iter().map(|row| row.counts as f64 / row.n as f64).collect();
        let y: Vec<f64> = rows.iter().map(|row| row.units as f64 / row.n as f64 / 1024.0).collect();
        let n: Vec<f64> = rows.iter().map(|row| row.n as f64).collect();
        let solutions = solve(rows, 9);
        assert_eq!(solutions.len(), 9);
        for (order, solution) in (1..).zip(&solutions) {
            let exact = Reference::fit(&x, &y, Some(&n), order).unwrap();
            for x in &x {
                let (got, want) = (solution.evaluate(*x), exact.evaluate(*x));
                assert!((got.hi - want).abs() <= 1e-16 * want.abs(), "order {order} at {x}: {got:?} {want}");
                // What is left of it is smaller than half of its last bit.
                assert!(got.lo.abs() <= 0.51 * f64::EPSILON * want.abs(), "order {order} at {x}: {got:?}");
            }
        }
    }

    #[test]
    fn rows_of_any_kind_agree_with_exact_integers() {
        // Powers of two as weights, so that means of counts are f64 without rounding.
        let row = |k: i64| {
            let n = 1 << (k % 4);
            Row { n, counts: n * (240 - 2 * k) + k % n, units: n * (k * k * 30 + (k * 7919) % 50) }
        };
        assert_same(&(0..50).map(row).collect::<Vec<_>>());
        let code = |k: i64| Row { n: 4, counts: 4 * (60_000 - 331 * k), units: 4 * (1500 * k + (k * 7919) % 500) };
        assert_same(&(0..47).map(code).collect::<Vec<_>>());
    }

    #[test]
    fn an_order_that_the_rows_do_not_carry_is_left_out() {
        let rows = [0, 1, 2, 3].map(|k| Row { n: 3, counts: 3 * (200 + k), units: 90 * k });
        assert_eq!(solve(&rows, 9).len(), 3);
        assert!(solve(&[rows[0]; 4], 9).is_empty());
        assert!(solve(&[], 9).is_empty());
    }
}
