//! Proof that a curve is monotone on its range, and the best monotone curve where it is not.

use crate::dd::Dd;
use crate::nnls::nnls;
use crate::orthogonal::Basis;
use crate::series::{Chebyshev, bernstein_of, chebyshev_of_powers, powers_of, powers_of_bernstein};

/// Halvings of the interval before the proof is given up; the part left is 1e-6 of the range.
const MAX_DEPTH: u32 = 20;

/// The slope of a repaired curve never falls below this share of its mean slope, so that rounding cannot turn it.
const MIN_SLOPE_SHARE: f64 = 1e-6;

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

/// The least-squares problem that a repair starts from, all in the variable s.
pub(crate) struct Problem<'a> {
    /// The basis over the rows.
    pub basis: &'a Basis,
    /// Abscissae of the rows.
    pub s: &'a [f64],
    /// Roots of the weights of the rows.
    pub root_n: &'a [f64],
    /// Unconstrained solution in the basis, at least `order + 1` long.
    pub d: &'a [f64],
    /// Order of the curve.
    pub order: usize,
    /// 1 for rising, -1 for falling.
    pub sign: f64,
}

/// The monotone polynomial that fits best, as a Chebyshev series in s.
///
/// With J_i the sum of the Bernstein polynomials i..p, P = b_0 + sign sum s_i J_i is monotone if all s_i >= 0. The
/// basis turns the rows into p equations, so the constrained problem is p by p however many rows there are.
pub(crate) fn repair(problem: &Problem<'_>, from: Dd, to: Dd, y_range: f64) -> Chebyshev {
    let p = problem.order;
    // Beyond the hull of the rows and the range J_i would not be monotone: take both.
    let hull = problem.s.iter().fold((from.hi, to.hi), |(lo, hi), s| (lo.min(*s), hi.max(*s)));
    let from = if hull.0 < from.hi { Dd::from(hull.0) } else { from };
    let to = if hull.1 > to.hi { Dd::from(hull.1) } else { to };
    let rows: Vec<Vec<f64>> = problem.s.iter().map(|s| cumulative((s - from.hi) / (to.hi - from.hi), p)).collect();
    // Each J_i in the orthonormal basis.
    let columns: Vec<Vec<f64>> = (0..p)
        .map(|i| {
            let weighted = rows.iter().zip(problem.root_n).map(|(row, root)| problem.sign * root * row[i]);
            let weighted: Vec<f64> = weighted.collect();
            problem.basis.project(&weighted)[..=p].to_vec()
        })
        .collect();
    let least = MIN_SLOPE_SHARE * y_range / p as f64;
    let target: Vec<f64> =
        (1..=p).map(|k| problem.d[k] - columns.iter().map(|column| least * column[k]).sum::<f64>()).collect();
    let inner: Vec<Vec<f64>> = columns.iter().map(|column| column[1..].to_vec()).collect();
    let steps: Vec<f64> = nnls(&inner, &target).iter().map(|s| s + least).collect();
    let constant = problem.d[0] - columns.iter().zip(&steps).map(|(column, s)| column[0] * s).sum::<f64>();
    let mut bernstein = vec![Dd::from(constant / problem.basis.weight.sqrt())];
    for step in &steps {
        let last = bernstein[bernstein.len() - 1];
        bernstein.push(last + Dd::from(problem.sign * step));
    }
    chebyshev_of_powers(&powers_of_bernstein(&bernstein, from, to))
}

/// The least sum of squares about any monotone function of the count, polynomial or not, by pooling adjacent
/// violators. `groups` are (samples, mean), ascending in count; what scatters within a group is not in the sum.
pub(crate) fn isotonic_squares(groups: impl Iterator<Item = (f64, f64)>, sign: f64) -> f64 {
    let mut pools: Vec<(f64, f64)> = Vec::new();
    let mut squares = 0.0;
    for (n, mean) in groups {
        let mut pool = (n, sign * mean);
        while let Some(&last) = pools.last().filter(|last| last.1 > pool.1) {
            pools.pop();
            let n = last.0 + pool.0;
            squares += last.0 * pool.0 / n * (last.1 - pool.1).powi(2);
            pool = (n, (last.0 * last.1 + pool.0 * pool.1) / n);
        }
        pools.push(pool);
    }
    squares
}

/// J_1(x) .. J_p(x), where J_i is the sum of the Bernstein polynomials i..p of order p.
fn cumulative(x: f64, p: usize) -> Vec<f64> {
    let mut bernstein = vec![1.0];
    for _ in 0..p {
        let mut next = vec![0.0; bernstein.len() + 1];
        for (j, b) in bernstein.iter().enumerate() {
            next[j] += (1.0 - x) * b;
            next[j + 1] += x * b;
        }
        bernstein = next;
    }
    let mut sum = 0.0;
    let mut sums: Vec<f64> = bernstein[1..]
        .iter()
        .rev()
        .map(|b| {
            sum += b;
            sum
        })
        .collect();
    sums.reverse();
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
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

    #[test]
    fn pooling_finds_the_least_squares() {
        // 3, 1 pool to 2 (2 squares); falling data pool to their mean.
        assert_eq!(isotonic_squares([(1.0, 3.0), (1.0, 1.0), (1.0, 5.0)].into_iter(), 1.0), 2.0);
        assert_eq!(isotonic_squares([(1.0, 3.0), (1.0, 2.0), (1.0, 1.0)].into_iter(), 1.0), 2.0);
        assert_eq!(isotonic_squares([(1.0, 3.0), (1.0, 2.0), (1.0, 1.0)].into_iter(), -1.0), 0.0);
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
