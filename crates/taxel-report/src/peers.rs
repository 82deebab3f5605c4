//! Fits as others would write them: the same contenders in every table of the report.
//!
//! Fair ones first: Chebyshev polynomials on the range of the data, by nalgebra's QR and SVD, and numpy's
//! `Polynomial.fit`, which scales the range too. Then what most would write: powers of the raw abscissa by QR, SVD,
//! normal equations and numpy's `polyfit`. All work on one row a sample, so that time and memory grow with the samples.

use std::hint::black_box;
use std::path::Path;

use nalgebra::{DMatrix, DVector};

use crate::numbers::timed_us;
use crate::numpy::Numpy;
pub use crate::polynomial::{Basis, Fitted, Polynomial, Samples};

/// Iterations that a singular value decomposition may take; healthy ones need a few a column. Without a limit a matrix
/// that is not finite would be iterated for ever.
const MAX_SVD_ITERATIONS: usize = 10_000;

#[derive(Clone, Copy)]
enum Solver {
    Qr,
    Svd,
    Normal,
}

#[derive(Clone, Copy)]
enum Method {
    Nalgebra(Basis, Solver),
    Numpy(&'static str),
}

/// What most would take first, and what the aim for precision is about.
pub(crate) const RAW_SVD: &str = "raw powers by SVD (nalgebra)";
/// What the aim for speed is about.
pub(crate) const POLYFIT: &str = "numpy.polyfit";

const METHODS: [(&str, Method); 7] = [
    ("Chebyshev by QR (nalgebra)", Method::Nalgebra(Basis::Chebyshev, Solver::Qr)),
    ("Chebyshev by SVD (nalgebra)", Method::Nalgebra(Basis::Chebyshev, Solver::Svd)),
    ("raw powers by QR (nalgebra)", Method::Nalgebra(Basis::Powers, Solver::Qr)),
    (RAW_SVD, Method::Nalgebra(Basis::Powers, Solver::Svd)),
    ("raw powers by normal equations", Method::Nalgebra(Basis::Powers, Solver::Normal)),
    ("numpy Polynomial.fit", Method::Numpy("polynomial")),
    (POLYFIT, Method::Numpy("polyfit")),
];

/// All who compete; numpy where Python has it.
pub struct Peers {
    numpy: Option<Numpy>,
    /// Whether numpy takes part, in words.
    pub said: String,
}

impl Peers {
    /// With numpy, if this Python has it.
    #[must_use]
    pub fn start(python: &Path) -> Self {
        match Numpy::start(python) {
            Ok(numpy) => Self { said: format!("{} takes part, by its own clock.", numpy.versions), numpy: Some(numpy) },
            Err(error) => Self { numpy: None, said: format!("numpy takes no part: {error:#}.") },
        }
    }

    /// Their names, the same and in the same order everywhere.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        let here = |method: &Method| self.numpy.is_some() || !matches!(method, Method::Numpy(_));
        METHODS.iter().filter(|(_, method)| here(method)).map(|(name, _)| *name).collect()
    }

    /// The polynomial of `order` by the method of this name. Without samples or a range there is none.
    ///
    /// # Errors
    /// numpy's process ended. A method that finds no curve is no error.
    pub fn fit(&mut self, name: &str, samples: &Samples<'_>, order: usize) -> anyhow::Result<Fitted> {
        let method = METHODS.iter().find(|(known, _)| *known == name).map(|(_, method)| *method);
        match (method, &mut self.numpy) {
            (Some(Method::Nalgebra(basis, solver)), _) => {
                let (us, curve) = timed_us(|| solve(black_box(samples), order, basis, solver));
                Ok(Fitted { us, curve })
            }
            (Some(Method::Numpy(method)), Some(numpy)) => numpy.fit(method, samples, order),
            _ => anyhow::bail!("`{name}` takes no part"),
        }
    }
}

fn solve(samples: &Samples<'_>, order: usize, basis: Basis, solver: Solver) -> Option<Polynomial> {
    let Samples { x, y, .. } = *samples;
    if x.is_empty() || x.len() != y.len() {
        return None;
    }
    let (mut centre, mut half_width) = (0.0, 1.0);
    if basis == Basis::Chebyshev {
        let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
        (centre, half_width) = (low / 2.0 + high / 2.0, high / 2.0 - low / 2.0);
        if !(half_width > 0.0 && half_width.is_finite()) {
            return None;
        }
    }
    let mut matrix = DMatrix::zeros(x.len(), order + 1);
    for (k, x) in x.iter().enumerate() {
        let (root, t) = (samples.root_of_weight(k), (x - centre) / half_width);
        let (mut now, mut next) = (1.0, t);
        for j in 0..=order {
            matrix[(k, j)] = root * now;
            let after = if basis == Basis::Chebyshev { 2.0 * t * next - now } else { t * next };
            (now, next) = (next, after);
        }
    }
    let right = DVector::from_fn(x.len(), |k, _| samples.root_of_weight(k) * y[k]);
    let solution = solver.solve(matrix, right)?;
    let finite = solution.iter().all(|c| c.is_finite());
    finite.then(|| Polynomial { basis, centre, half_width, coefficients: solution.as_slice().to_vec() })
}

impl Solver {
    fn solve(self, matrix: DMatrix<f64>, mut right: DVector<f64>) -> Option<DVector<f64>> {
        let columns = matrix.ncols();
        match self {
            Self::Qr if matrix.nrows() < columns => None,
            Self::Qr => {
                let qr = matrix.qr();
                qr.q_tr_mul(&mut right);
                qr.unpack_r().solve_upper_triangular(&right.rows(0, columns))
            }
            Self::Svd if matrix.iter().chain(right.iter()).any(|value| !value.is_finite()) => None,
            // Cut at the machine's epsilon times the largest singular value.
            Self::Svd => {
                let svd = matrix.try_svd(true, true, 5.0 * f64::EPSILON, MAX_SVD_ITERATIONS)?;
                svd.solve(&right, f64::EPSILON * svd.singular_values.max()).ok()
            }
            Self::Normal => Some(matrix.tr_mul(&matrix).cholesky()?.solve(&matrix.tr_mul(&right))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peers() -> Peers {
        Peers { numpy: None, said: String::new() }
    }

    fn fit(name: &str, x: &[f64], y: &[f64], w: Option<&[f64]>, order: usize) -> Option<Polynomial> {
        peers().fit(name, &Samples { x, y, w }, order).unwrap().curve
    }

    #[test]
    fn all_find_a_cubic_again_and_weights_are_repeated_samples() {
        let x: Vec<f64> = (0..40).map(|k| f64::from(k) / 10.0 - 1.0).collect();
        let truth = |x: f64| 1.0 + x * (2.0 + x * (3.0 + x * 4.0));
        let y: Vec<f64> = x.iter().map(|x| truth(*x)).collect();
        let (few_x, few_y) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 2.0, 1.0, 3.0, 7.0]);
        let (many_x, many_y) = ([&few_x[..], &[1.0, 1.0, 3.0]].concat(), [&few_y[..], &[2.0, 2.0, 3.0]].concat());
        for name in peers().names() {
            let cubic = fit(name, &x, &y, None, 3).unwrap();
            assert!(x.iter().all(|x| (cubic.evaluate(*x) - truth(*x)).abs() < 1e-9), "{name}: {cubic:?}");
            let weighted = fit(name, &few_x, &few_y, Some(&[1.0, 3.0, 1.0, 2.0, 1.0]), 2).unwrap();
            let repeated = fit(name, &many_x, &many_y, None, 2).unwrap();
            assert!(few_x.iter().all(|x| (weighted.evaluate(*x) - repeated.evaluate(*x)).abs() < 1e-10), "{name}");
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_none_and_never_a_panic() {
        for name in peers().names() {
            assert_eq!(fit(name, &[], &[], None, 2), None);
            assert_eq!(fit(name, &[1.0, 2.0], &[1.0], None, 1), None);
            assert_eq!(fit(name, &[1.0, f64::NAN, 3.0, 4.0], &[1.0, 2.0, 3.0, 4.0], None, 1), None, "{name}");
            let flat = fit(name, &[7.0; 9], &[1.0; 9], None, 1);
            assert!(flat.is_none() || !name.starts_with("Chebyshev"), "{name}");
        }
        assert_eq!(fit("raw powers by QR (nalgebra)", &[1.0, 2.0], &[1.0, 2.0], None, 5), None);
        assert!(peers().fit(POLYFIT, &Samples { x: &[], y: &[], w: None }, 1).is_err());
    }
}
