//! Fits as most would write them, on nalgebra's decompositions: the contenders of the report.
//!
//! Raw powers of the abscissa with QR, SVD and normal equations, and the textbook's cure: Chebyshev polynomials on the
//! range of the data, by QR. All work on one row a sample, so that time and memory grow with the samples.

use nalgebra::{DMatrix, DVector};

/// Iterations that a singular value decomposition may take; healthy ones need a few a column. Without a limit a matrix
/// that is not finite would be iterated for ever.
const MAX_SVD_ITERATIONS: usize = 10_000;

/// What a peer gives.
#[derive(Clone, Debug, PartialEq)]
pub enum Polynomial {
    /// In powers of the raw abscissa.
    Raw {
        /// Ascending.
        coefficients: Vec<f64>,
    },
    /// In Chebyshev polynomials of t = (x - centre) / half_width.
    Chebyshev {
        /// Middle of the range of the data.
        centre: f64,
        /// Half of its width; above 0.
        half_width: f64,
        /// Ascending.
        coefficients: Vec<f64>,
    },
}

impl Polynomial {
    /// The value at `x`: Horner's scheme for raw powers, Clenshaw's for Chebyshev polynomials.
    #[must_use]
    pub fn evaluate(&self, x: f64) -> f64 {
        match self {
            Self::Raw { coefficients } => coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c),
            Self::Chebyshev { centre, half_width, coefficients } => {
                let t = (x - centre) / half_width;
                let step = |(b1, b2): (f64, f64), c: &f64| (2.0 * t * b1 - b2 + c, b1);
                let (b1, b2) = coefficients.iter().rev().fold((0.0, 0.0), step);
                b1 - t * b2
            }
        }
    }

    /// Coefficients in ascending powers of the raw abscissa, where the method works with these.
    #[must_use]
    pub fn raw_coefficients(&self) -> Option<&[f64]> {
        match self {
            Self::Raw { coefficients } => Some(coefficients),
            Self::Chebyshev { .. } => None,
        }
    }
}

/// A weighted problem as matrix and right side, one row a sample, both scaled with the root of the weight.
struct Rows {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Rows {
    /// `None` if there is no sample, or lengths differ.
    fn new(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize, basis: impl Fn(f64, &mut [f64])) -> Option<Self> {
        if x.is_empty() || x.len() != y.len() || w.is_some_and(|w| w.len() != x.len()) {
            return None;
        }
        let root = |k: usize| w.map_or(1.0, |w| w[k].sqrt());
        let mut matrix = DMatrix::zeros(x.len(), order + 1);
        let mut row = vec![0.0; order + 1];
        for (k, x) in x.iter().enumerate() {
            basis(*x, &mut row);
            row.iter().enumerate().for_each(|(j, value)| matrix[(k, j)] = root(k) * value);
        }
        let right = DVector::from_fn(x.len(), |k, _| root(k) * y[k]);
        Some(Self { matrix, right })
    }

    /// Householder QR without pivots. `None` with fewer rows than columns, or a triangle that is singular.
    fn solve_qr(self) -> Option<Vec<f64>> {
        let columns = self.matrix.ncols();
        if self.matrix.nrows() < columns {
            return None;
        }
        let qr = self.matrix.qr();
        let mut right = self.right;
        qr.q_tr_mul(&mut right);
        finite(qr.unpack_r().solve_upper_triangular(&right.rows(0, columns))?)
    }
}

fn raw_rows(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Rows> {
    Rows::new(x, y, w, order, |x, row| {
        row.iter_mut().fold(1.0, |power, value| {
            *value = power;
            power * x
        });
    })
}

fn finite(solution: DVector<f64>) -> Option<Vec<f64>> {
    solution.iter().all(|c| c.is_finite()).then(|| solution.as_slice().to_vec())
}

/// Raw powers, Householder QR. `x`, `y` and the weights `w` have one value a sample; `None` where the method gives no
/// finite polynomial, for example with fewer samples than coefficients.
#[must_use]
pub fn fit_raw_qr(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Polynomial> {
    Some(Polynomial::Raw { coefficients: raw_rows(x, y, w, order)?.solve_qr()? })
}

/// Raw powers, singular value decomposition, cut at the machine's epsilon times the largest singular value. Arguments
/// as for [`fit_raw_qr`]; gives the shortest of many solutions.
#[must_use]
pub fn fit_raw_svd(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Polynomial> {
    let Rows { matrix, right } = raw_rows(x, y, w, order)?;
    if matrix.iter().chain(right.iter()).any(|value| !value.is_finite()) {
        return None;
    }
    let svd = matrix.try_svd(true, true, 5.0 * f64::EPSILON, MAX_SVD_ITERATIONS)?;
    let cut = f64::EPSILON * svd.singular_values.max();
    Some(Polynomial::Raw { coefficients: finite(svd.solve(&right, cut).ok()?)? })
}

/// Raw powers, normal equations, Cholesky. Arguments as for [`fit_raw_qr`].
#[must_use]
pub fn fit_raw_normal(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Polynomial> {
    let Rows { matrix, right } = raw_rows(x, y, w, order)?;
    let solution = matrix.tr_mul(&matrix).cholesky()?.solve(&matrix.tr_mul(&right));
    Some(Polynomial::Raw { coefficients: finite(solution)? })
}

/// Chebyshev polynomials on the range of `x`, Householder QR. Arguments as for [`fit_raw_qr`].
#[must_use]
pub fn fit_chebyshev_qr(x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Polynomial> {
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
    let (centre, half_width) = (low / 2.0 + high / 2.0, high / 2.0 - low / 2.0);
    if !(half_width > 0.0 && half_width.is_finite()) {
        return None;
    }
    let rows = Rows::new(x, y, w, order, |x, row| {
        let t = (x - centre) / half_width;
        row.iter_mut().fold((1.0, t), |(now, next), value| {
            *value = now;
            (next, 2.0 * t * next - now)
        });
    })?;
    Some(Polynomial::Chebyshev { centre, half_width, coefficients: rows.solve_qr()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    type Fit = fn(&[f64], &[f64], Option<&[f64]>, usize) -> Option<Polynomial>;
    const ALL: [Fit; 4] = [fit_raw_qr, fit_raw_svd, fit_raw_normal, fit_chebyshev_qr];

    #[test]
    fn all_find_a_cubic_again() {
        let x: Vec<f64> = (0..40).map(|k| f64::from(k) / 10.0 - 1.0).collect();
        let truth = |x: f64| 1.0 + x * (2.0 + x * (3.0 + x * 4.0));
        let y: Vec<f64> = x.iter().map(|x| truth(*x)).collect();
        for fit in ALL {
            let polynomial = fit(&x, &y, None, 3).unwrap();
            assert!(x.iter().all(|x| (polynomial.evaluate(*x) - truth(*x)).abs() < 1e-9), "{polynomial:?}");
            for (got, want) in polynomial.raw_coefficients().into_iter().flatten().zip([1.0, 2.0, 3.0, 4.0]) {
                assert!((got - want).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn weights_are_repeated_samples() {
        let (x, y) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 2.0, 1.0, 3.0, 7.0]);
        let (mut many_x, mut many_y) = (x.to_vec(), y.to_vec());
        many_x.extend([1.0, 1.0, 3.0]);
        many_y.extend([2.0, 2.0, 3.0]);
        for fit in ALL {
            let weighted = fit(&x, &y, Some(&[1.0, 3.0, 1.0, 2.0, 1.0]), 2).unwrap();
            let repeated = fit(&many_x, &many_y, None, 2).unwrap();
            assert!(x.iter().all(|x| (weighted.evaluate(*x) - repeated.evaluate(*x)).abs() < 1e-10));
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_none_and_never_a_panic() {
        for fit in ALL {
            assert_eq!(fit(&[], &[], None, 2), None);
            assert_eq!(fit(&[1.0, 2.0], &[1.0], None, 1), None);
            assert_eq!(fit(&[1.0, f64::NAN, 3.0, 4.0], &[1.0, 2.0, 3.0, 4.0], None, 1), None);
        }
        assert_eq!(fit_raw_qr(&[1.0, 2.0], &[1.0, 2.0], None, 5), None);
        assert_eq!(fit_chebyshev_qr(&[7.0; 9], &[1.0; 9], None, 1), None);
    }
}
