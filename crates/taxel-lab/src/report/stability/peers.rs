//! Fits as others would write them.
//!
//! A fair one first: Chebyshev polynomials on the range of the data, by QR. Then what most would write: powers of the raw
//! abscissa by QR and normal equations, all by nalgebra. They work on one row a sample, so that time and memory grow
//! with the samples.

use nalgebra::{DMatrix, DVector};

/// A way to fit a polynomial.
#[derive(Clone, Copy)]
pub(crate) struct Peer {
    /// The same everywhere.
    pub name: &'static str,
    /// A sum of Chebyshev polynomials on the range of the data instead of powers of the raw abscissa.
    chebyshev: bool,
    /// Matrix, one row a sample, and right side.
    solve: fn(DMatrix<f64>, DVector<f64>) -> Option<DVector<f64>>,
}

/// All of them, in the same order everywhere.
pub(crate) const PEERS: [Peer; 3] = [
    Peer { name: "Chebyshev by QR", chebyshev: true, solve: qr },
    Peer { name: "raw powers by QR", chebyshev: false, solve: qr },
    Peer { name: "raw powers by normal equations", chebyshev: false, solve: normal },
];

/// What a peer gives: a polynomial in t = (x - centre) / half_width, which is x itself where the abscissa is taken raw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Polynomial {
    chebyshev: bool,
    centre: f64,
    half_width: f64,
    /// Ascending.
    coefficients: Vec<f64>,
}

impl Polynomial {
    /// The value at `x`: Horner's scheme for powers, Clenshaw's for Chebyshev polynomials.
    pub fn evaluate(&self, x: f64) -> f64 {
        let (t, terms) = ((x - self.centre) / self.half_width, self.coefficients.iter().rev());
        if !self.chebyshev {
            return terms.fold(0.0, |sum, c| sum * t + c);
        }
        let (b1, b2) = terms.fold((0.0, 0.0), |(b1, b2), c| (2.0 * t * b1 - b2 + c, b1));
        b1 - t * b2
    }
}

impl Peer {
    /// The polynomial of `order` through (x, y), one value a sample; `None` where the method finds no finite one.
    pub fn fit(&self, x: &[f64], y: &[f64], order: usize) -> Option<Polynomial> {
        let chebyshev = self.chebyshev;
        let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(*x), hi.max(*x)));
        let (centre, half_width) =
            if chebyshev { (low / 2.0 + high / 2.0, high / 2.0 - low / 2.0) } else { (0.0, 1.0) };
        if x.is_empty() || x.len() != y.len() || half_width <= 0.0 || !half_width.is_finite() {
            return None;
        }
        let mut matrix = DMatrix::zeros(x.len(), order + 1);
        for (k, x) in x.iter().enumerate() {
            let t = (x - centre) / half_width;
            let (mut now, mut next) = (1.0, t);
            for j in 0..=order {
                matrix[(k, j)] = now;
                (now, next) = (next, if chebyshev { 2.0 * t * next - now } else { t * next });
            }
        }
        let solution = (self.solve)(matrix, DVector::from_column_slice(y))?;
        let coefficients = solution.as_slice().to_vec();
        let finite = coefficients.iter().all(|c| c.is_finite());
        finite.then_some(Polynomial { chebyshev, centre, half_width, coefficients })
    }
}

fn qr(matrix: DMatrix<f64>, mut right: DVector<f64>) -> Option<DVector<f64>> {
    let columns = matrix.ncols();
    let qr = (matrix.nrows() >= columns).then(|| matrix.qr())?;
    qr.q_tr_mul(&mut right);
    qr.unpack_r().solve_upper_triangular(&right.rows(0, columns))
}

fn normal(matrix: DMatrix<f64>, right: DVector<f64>) -> Option<DVector<f64>> {
    Some(matrix.tr_mul(&matrix).cholesky()?.solve(&matrix.tr_mul(&right)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_find_a_cubic_again() {
        let x: Vec<f64> = (0..40).map(|k| f64::from(k) / 10.0 - 1.0).collect();
        let truth = |x: f64| 1.0 + x * (2.0 + x * (3.0 + x * 4.0));
        let y: Vec<f64> = x.iter().map(|x| truth(*x)).collect();
        for peer in PEERS {
            let cubic = peer.fit(&x, &y, 3).unwrap();
            assert!(x.iter().all(|x| (cubic.evaluate(*x) - truth(*x)).abs() < 1e-9), "{}: {cubic:?}", peer.name);
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_none_and_never_a_panic() {
        for peer in PEERS {
            assert_eq!(peer.fit(&[], &[], 2), None);
            assert_eq!(peer.fit(&[1.0, 2.0], &[1.0], 1), None);
            assert_eq!(peer.fit(&[1.0, f64::NAN, 3.0, 4.0], &[1.0, 2.0, 3.0, 4.0], 1), None, "{}", peer.name);
        }
        assert_eq!(PEERS[0].fit(&[7.0; 9], &[1.0; 9], 1), None);
        assert_eq!(PEERS[1].fit(&[1.0, 2.0], &[1.0, 2.0], 5), None);
    }
}
