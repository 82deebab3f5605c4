//! Least squares with coefficients that are not negative, for a few unknowns and many right-hand sides.
//!
//! By normal equations: the columns are sums of Bernstein polynomials between 0 and 1, of order 7 at most, so that
//! squaring their condition leaves ten digits. What a fold holds is subtracted, not summed anew.

/// Most unknowns: the coefficients of a curve of order 7 and its zero.
pub(super) const UNKNOWNS: usize = 8;

/// A row of the problem, or its solution.
pub(super) type Row = [f64; UNKNOWNS];

/// A pivot that elimination leaves so small a share of is a column that depends on others.
const DEPENDENT: f64 = 1e-13;

/// The normal equations of weighted rows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normal {
    matrix: [Row; UNKNOWNS],
}

impl Normal {
    /// Adds a row with its weight.
    pub fn add(&mut self, row: &Row, weight: f64) {
        for (line, a) in self.matrix.iter_mut().zip(row) {
            line.iter_mut().zip(row).for_each(|(sum, b)| *sum += weight * a * b);
        }
    }

    /// What is left without the rows of `other`.
    pub fn less(&self, other: &Self) -> Self {
        let mut left = *self;
        for (line, other) in left.matrix.iter_mut().zip(&other.matrix) {
            line.iter_mut().zip(other).for_each(|(a, b)| *a -= b);
        }
        // What is left of a column that only `other` had is rounding.
        for i in 0..UNKNOWNS {
            if left.matrix[i][i] <= DEPENDENT * self.matrix[i][i] {
                left.matrix[i] = [0.0; UNKNOWNS];
                left.matrix.iter_mut().for_each(|line| line[i] = 0.0);
            }
        }
        left
    }

    /// The solution for the right-hand side `moments` (weighted sums of row times value), of which all but those `free`
    /// are not negative. Lawson and Hanson (1974), chapter 23, after a try without bounds.
    pub fn solve(&self, moments: &Row, free: usize) -> Row {
        let is_free = |j: usize| j == free;
        let (unbounded, independent) = self.subset(moments, [true; UNKNOWNS]);
        let feasible = (0..UNKNOWNS).all(|j| is_free(j) || unbounded[j] >= 0.0);
        if feasible && independent {
            return unbounded;
        }
        let mut passive: [bool; UNKNOWNS] = std::array::from_fn(is_free);
        let (mut x, _) = self.subset(moments, passive);
        let mut barred = [false; UNKNOWNS];
        for _ in 0..10 * UNKNOWNS {
            let gain = self.residual(moments, &x);
            // The size of the terms that a gradient is the difference of.
            let tolerance = |j: usize| DEPENDENT * (moments[j].abs() + f64::MIN_POSITIVE);
            let candidates = (0..UNKNOWNS).filter(|&j| !passive[j] && !barred[j] && gain[j] > tolerance(j));
            let Some(entering) = candidates.max_by(|&i, &j| gain[i].total_cmp(&gain[j])) else { break };
            passive[entering] = true;
            self.descend(moments, &mut x, &mut passive, free);
            if passive[entering] {
                barred = [false; UNKNOWNS];
            } else {
                barred[entering] = true;
            }
        }
        x
    }

    /// Moves to the least squares over the passive unknowns, and drops those that would turn negative.
    fn descend(&self, moments: &Row, x: &mut Row, passive: &mut [bool; UNKNOWNS], free: usize) {
        loop {
            let (best, _) = self.subset(moments, *passive);
            let ratio = |j: usize| {
                let step = x[j] / (x[j] - best[j]);
                if step.is_finite() { step.clamp(0.0, 1.0) } else { 0.0 }
            };
            let blocking = (0..UNKNOWNS).filter(|&j| j != free && passive[j] && best[j] <= 0.0);
            let Some(first) = blocking.min_by(|&i, &j| ratio(i).total_cmp(&ratio(j))) else {
                *x = best;
                return;
            };
            let step = ratio(first);
            for j in 0..UNKNOWNS {
                x[j] += step * (best[j] - x[j]);
                if j != free && (j == first || x[j] <= 0.0) {
                    x[j] = 0.0;
                    passive[j] = false;
                }
            }
        }
    }

    fn residual(&self, moments: &Row, x: &Row) -> Row {
        std::array::from_fn(|i| moments[i] - self.matrix[i].iter().zip(x).map(|(a, x)| a * x).sum::<f64>())
    }

    /// The solution over the `passive` unknowns, refined once, and whether all columns that are not zero are independent.
    fn subset(&self, moments: &Row, passive: [bool; UNKNOWNS]) -> (Row, bool) {
        let (factor, independent) = self.factor(passive);
        let first = solve(&factor, moments);
        let rest = self.residual(moments, &first);
        let second = solve(&factor, &rest);
        (std::array::from_fn(|j| first[j] + second[j]), independent)
    }

    /// Cholesky's factor; a diagonal of 0 marks an unknown that is left at 0.
    fn factor(&self, passive: [bool; UNKNOWNS]) -> ([Row; UNKNOWNS], bool) {
        let mut factor = [[0.0; UNKNOWNS]; UNKNOWNS];
        let mut independent = true;
        for i in 0..UNKNOWNS {
            let whole = self.matrix[i][i];
            if !passive[i] || whole <= 0.0 {
                continue;
            }
            for j in 0..i {
                if factor[j][j] > 0.0 {
                    let inner: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                    factor[i][j] = (self.matrix[i][j] - inner) / factor[j][j];
                }
            }
            let pivot = whole - factor[i][..i].iter().map(|a| a * a).sum::<f64>();
            if pivot > DEPENDENT * whole {
                factor[i][i] = pivot.sqrt();
            } else {
                factor[i] = [0.0; UNKNOWNS];
                independent = false;
            }
        }
        (factor, independent)
    }
}

/// Forward and backward substitution.
fn solve(factor: &[Row; UNKNOWNS], moments: &Row) -> Row {
    let mut x = [0.0; UNKNOWNS];
    for i in (0..UNKNOWNS).filter(|&i| factor[i][i] > 0.0) {
        let inner: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
        x[i] = (moments[i] - inner) / factor[i][i];
    }
    for i in (0..UNKNOWNS).rev().filter(|&i| factor[i][i] > 0.0) {
        let inner: f64 = (i + 1..UNKNOWNS).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (x[i] - inner) / factor[i][i];
    }
    x
}

/// No unknown is free of a bound.
pub(super) const NONE_FREE: usize = UNKNOWNS;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(rows: &[Row], values: &[f64]) -> (Normal, Row) {
        let (mut normal, mut moments) = (Normal::default(), Row::default());
        for (row, value) in rows.iter().zip(values) {
            normal.add(row, 1.0);
            moments.iter_mut().zip(row).for_each(|(sum, a)| *sum += a * value);
        }
        (normal, moments)
    }

    proptest! {
        /// Karush-Kuhn-Tucker: the gradient is 0 where x > 0 or free, and points outwards where x = 0.
        #[test]
        fn the_optimality_conditions_hold(
            rows in proptest::collection::vec(proptest::array::uniform8(-1.0..1.0_f64), 10..20),
            values in proptest::collection::vec(-1.0..1.0_f64, 20), free in 0..=UNKNOWNS,
        ) {
            let (normal, moments) = of(&rows, &values);
            let x = normal.solve(&moments, free);
            let gain = normal.residual(&moments, &x);
            for j in 0..UNKNOWNS {
                prop_assert!(j == free || x[j] >= 0.0);
                prop_assert!(gain[j] <= 1e-7, "unknown {j}: {gain:?}");
                prop_assert!((j != free && x[j] == 0.0) || gain[j].abs() <= 1e-7, "unknown {j}: {gain:?}");
            }
        }
    }

    #[test]
    fn dependent_columns_do_no_harm() {
        let row = |a: f64| [a, 2.0 * a, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let (normal, moments) = of(&[row(1.0), row(1.0)], &[3.0, 3.0]);
        let x = normal.solve(&moments, NONE_FREE);
        assert!((x[0] + 2.0 * x[1] - 3.0).abs() < 1e-12, "{x:?}");
    }
}
