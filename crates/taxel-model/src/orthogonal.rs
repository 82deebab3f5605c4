//! Polynomials that are orthonormal over the rows of a problem: the sound basis for least squares.
//!
//! Weighted Stieltjes/Arnoldi process (Brubeck, Nakatsukasa, Trefethen 2021, "Vandermonde with Arnoldi"): multiply the
//! last vector by the abscissa, orthogonalise against all earlier ones, twice. Leverages and the fits of all
//! lower orders fall out of the vectors; no matrix is inverted.

/// A basis vector whose length falls below this part of what it was before orthogonalisation holds only rounding:
/// the abscissae carry no further order.
const RANK_TOLERANCE: f64 = 1e-10;

/// Orthonormal vectors sqrt(n) phi_k(t) over the rows, and the recurrence that defines phi_k for any t:
/// beta_k phi_{k+1} = (t - alpha_k) phi_k - beta_{k-1} phi_{k-1}, phi_0 = 1 / sqrt(sum n).
#[derive(Clone, Debug)]
pub(crate) struct Basis {
    /// vectors[k][r] = sqrt(n_r) phi_k(t_r).
    pub vectors: Vec<Vec<f64>>,
    pub alpha: Vec<f64>,
    pub beta: Vec<f64>,
    /// Sum of the weights.
    pub weight: f64,
}

/// Dot product in eight lanes of fixed order: fast, and the same on every machine.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    // In halves, so that neighbours stay in one vector to the end.
    let [a, b, c, d, e, f, g, h] = lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h)) + rest
}

impl Basis {
    /// The basis of order `max_order` or of the highest order that the abscissae carry, whichever is lower.
    ///
    /// `t` are the abscissae, roughly within -1..1; `root_n` are the roots of positive weights. At least one row.
    pub fn new(t: &[f64], root_n: &[f64], max_order: usize) -> Self {
        let weight = dot(root_n, root_n);
        let first: Vec<f64> = root_n.iter().map(|root| root / weight.sqrt()).collect();
        let mut basis = Self { vectors: vec![first], alpha: Vec::new(), beta: Vec::new(), weight };
        for k in 0..max_order.min(t.len().saturating_sub(1)) {
            let mut v: Vec<f64> = t.iter().zip(&basis.vectors[k]).map(|(t, q)| t * q).collect();
            let before = dot(&v, &v).sqrt();
            let mut alpha = 0.0;
            // Only the last two are not orthogonal but for rounding, which the second round takes out.
            for from in [k.saturating_sub(1), 0] {
                for (j, q) in basis.vectors.iter().enumerate().skip(from) {
                    let h = dot(q, &v);
                    v.iter_mut().zip(q).for_each(|(v, q)| *v -= h * q);
                    alpha += if j == k { h } else { 0.0 };
                }
            }
            let length = dot(&v, &v).sqrt();
            if length.is_nan() || length <= RANK_TOLERANCE * before {
                break;
            }
            v.iter_mut().for_each(|v| *v /= length);
            basis.alpha.push(alpha);
            basis.beta.push(length);
            basis.vectors.push(v);
        }
        basis
    }

    /// The highest order of the basis.
    pub fn order(&self) -> usize {
        self.vectors.len() - 1
    }

    /// Coefficients in the basis of the least-squares fit to `z`, which are sqrt(n) y; accumulated twice.
    pub fn project(&self, z: &[f64]) -> Vec<f64> {
        let mut rest = z.to_vec();
        let mut d = vec![0.0; self.vectors.len()];
        for _ in 0..2 {
            for (d, q) in d.iter_mut().zip(&self.vectors) {
                let h = dot(q, &rest);
                rest.iter_mut().zip(q).for_each(|(r, q)| *r -= h * q);
                *d += h;
            }
        }
        d
    }

    /// sqrt(n) times the value of the polynomial with coefficients `d`, at every row.
    pub fn weighted_values(&self, d: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.vectors[0].len()];
        for (q, d) in self.vectors.iter().zip(d) {
            values.iter_mut().zip(q).for_each(|(value, q)| *value += d * q);
        }
        values
    }

    /// The part that each row has in its own fitted value, for the orders 0..=`order`.
    pub fn row_leverages(&self, order: usize) -> Vec<f64> {
        let mut leverages = vec![0.0; self.vectors[0].len()];
        for q in &self.vectors[..=order] {
            leverages.iter_mut().zip(q).for_each(|(leverage, q)| *leverage += q * q);
        }
        leverages
    }

    /// Leverage sum phi_k(t)^2 of one new sample at each `t` over the orders 0..=`order`, and phi_order(t).
    pub fn leverages(&self, t: &[f64], order: usize) -> Vec<(f64, f64)> {
        let first = 1.0 / self.weight.sqrt();
        let mut last = vec![0.0; t.len()];
        let mut leverages = vec![(first * first, first); t.len()];
        for k in 0..order.min(self.order()) {
            let (alpha, length) = (self.alpha[k], self.beta[k]);
            let beta = if k == 0 { 0.0 } else { self.beta[k - 1] };
            for ((t, last), (leverage, phi)) in t.iter().zip(&mut last).zip(&mut leverages) {
                (*last, *phi) = (*phi, ((t - alpha) * *phi - beta * *last) / length);
                *leverage += *phi * *phi;
            }
        }
        leverages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vectors_are_orthonormal_to_the_last_digits() {
        let t: Vec<f64> = (0..80).map(|i| (f64::from(i) - 40.0) / 40.0).collect();
        let root_n: Vec<f64> = (0..80).map(|i| (1.0 + f64::from(i * i % 17)).sqrt()).collect();
        let basis = Basis::new(&t, &root_n, 10);
        assert_eq!(basis.order(), 10);
        for (i, a) in basis.vectors.iter().enumerate() {
            for (j, b) in basis.vectors.iter().enumerate() {
                let want = if i == j { 1.0 } else { 0.0 };
                assert!((dot(a, b) - want).abs() < 4e-16 * 4.0, "{i} {j} {}", dot(a, b) - want);
            }
        }
        for k in 0..=10 {
            for (r, (leverage, phi)) in basis.leverages(&t, k).iter().enumerate() {
                assert!((phi * root_n[r] - basis.vectors[k][r]).abs() < 1e-12, "recurrence {k} at row {r}");
                let of_row = basis.row_leverages(k)[r];
                assert!((leverage * root_n[r].powi(2) - of_row).abs() < 1e-12, "leverage {k} at row {r}");
            }
        }
    }

    #[test]
    fn three_abscissae_carry_order_two() {
        let basis = Basis::new(&[-1.0, -1.0, 0.0, 1.0, 1.0, 1.0], &[1.0; 6], 5);
        assert_eq!(basis.order(), 2);
    }
}
