//! The least-squares solution to double-double accuracy at a small multiple of the f64 cost.
//!
//! The f64 recurrence coefficients are taken as exact numbers: they define polynomials phi_k that are orthonormal
//! up to about 1e-14. Evaluated in double-double, their Gram matrix is the identity plus that little, so that each
//! pass d += sum n phi r, r = y - sum d phi gains about 14 digits: two passes reach the limit of double-double.
//! Plain f64 (of any method) has some nine digits on a problem like Wampler's, whose values outgrow its coefficients
//! by six orders of magnitude; a refinement of the residual alone stalls where the residuals are large, because the
//! basis, too, must be known to more digits.

use crate::dd::Dd;
use crate::orthogonal::Basis;
use crate::reduce::Row;

/// Passes in the ordinary case, and at most.
const PASSES: usize = 2;
const MAX_PASSES: usize = 8;

/// A correction below this part of the solution changes no digit of a double-double that matters.
const CONVERGED: f64 = 1e-29;

/// Recurrence of a basis in double-double.
#[derive(Clone, Debug)]
pub(crate) struct Recurrence {
    pub alpha: Vec<Dd>,
    pub beta: Vec<Dd>,
    /// phi_0.
    pub first: Dd,
}

impl Recurrence {
    fn of(basis: &Basis, order: usize) -> Self {
        let wide = |v: &[f64]| v[..order].iter().copied().map(Dd::from).collect();
        Self {
            alpha: wide(&basis.alpha),
            beta: wide(&basis.beta),
            first: Dd::from(1.0).div(Dd::from(basis.weight).sqrt()),
        }
    }
}

/// The solution in the polynomials of `recurrence`.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub recurrence: Recurrence,
    pub d: Vec<Dd>,
}

/// Solves for `order` at abscissae `t`, of which the basis knows the rounded values.
pub(crate) fn solve(basis: &Basis, rows: &[Row], t: &[Dd], order: usize, exact: bool) -> Solution {
    let recurrence = if exact { stieltjes(rows, t, order) } else { None };
    let recurrence = recurrence.unwrap_or_else(|| Recurrence::of(basis, order));
    let phi = values(&recurrence, t);
    let mut d = vec![Dd::ZERO; phi.len()];
    let mut residual: Vec<Dd> = rows.iter().map(|row| row.y).collect();
    let mut last = f64::INFINITY;
    for pass in 1..=MAX_PASSES {
        let correction: Vec<Dd> = phi.iter().map(|phi| weighted_dot(rows, phi, &residual)).collect();
        let size = correction.iter().map(|g| g.hi.abs()).fold(0.0, f64::max);
        if !size.is_finite() || size >= last {
            break;
        }
        last = size;
        d.iter_mut().zip(&correction).for_each(|(d, g)| *d = *d + *g);
        let scale = d.iter().map(|d| d.hi.abs()).fold(0.0, f64::max);
        // After the second pass the next correction would be about (size / first size)^2 of the solution.
        let settled = size <= CONVERGED * scale || (pass >= PASSES && !exact && size <= 1e-12 * scale);
        if settled {
            break;
        }
        for (phi, g) in phi.iter().zip(&correction) {
            residual.iter_mut().zip(phi).for_each(|(r, phi)| *r = *r - *phi * *g);
        }
    }
    Solution { recurrence, d }
}

fn weighted_dot(rows: &[Row], a: &[Dd], b: &[Dd]) -> Dd {
    rows.iter().zip(a).zip(b).fold(Dd::ZERO, |sum, ((row, a), b)| sum + (*a * *b).scale(row.n))
}

/// phi_k(t_r) for all k of the recurrence.
fn values(recurrence: &Recurrence, t: &[Dd]) -> Vec<Vec<Dd>> {
    let mut phi = vec![vec![recurrence.first; t.len()]];
    for (k, (alpha, beta)) in recurrence.alpha.iter().zip(&recurrence.beta).enumerate() {
        let inverse = Dd::from(1.0).div(*beta);
        let next = (0..t.len())
            .map(|r| {
                let earlier = if k == 0 { Dd::ZERO } else { phi[k - 1][r] * recurrence.beta[k - 1] };
                ((t[r] - *alpha) * phi[k][r] - earlier) * inverse
            })
            .collect();
        phi.push(next);
    }
    phi
}

/// The recurrence by the Stieltjes process in double-double, each vector orthogonalised twice against all earlier
/// ones; `None` where a vector vanishes.
fn stieltjes(rows: &[Row], t: &[Dd], order: usize) -> Option<Recurrence> {
    let weight = rows.iter().fold(Dd::ZERO, |sum, row| sum + Dd::from(row.n));
    let first = Dd::from(1.0).div(weight.sqrt());
    let mut recurrence = Recurrence { alpha: Vec::new(), beta: Vec::new(), first };
    let mut phi = vec![vec![first; t.len()]];
    for k in 0..order {
        let mut v: Vec<Dd> = t.iter().zip(&phi[k]).map(|(t, q)| *t * *q).collect();
        let mut alpha = Dd::ZERO;
        for _ in 0..2 {
            for (j, q) in phi.iter().enumerate() {
                let h = weighted_dot(rows, q, &v);
                v.iter_mut().zip(q).for_each(|(v, q)| *v = *v - h * *q);
                alpha = if j == k { alpha + h } else { alpha };
            }
        }
        let length = weighted_dot(rows, &v, &v).sqrt();
        if length.hi <= 0.0 || !length.hi.is_finite() {
            return None;
        }
        let inverse = Dd::from(1.0).div(length);
        v.iter_mut().for_each(|v| *v = *v * inverse);
        recurrence.alpha.push(alpha);
        recurrence.beta.push(length);
        phi.push(v);
    }
    Some(recurrence)
}
