//! The least-squares solution to double-double accuracy at a small multiple of the f64 cost.
//!
//! The f64 recurrence coefficients are taken as exact numbers: they define polynomials phi_k that are orthonormal up
//! to about 1e-14. Evaluated in double-double, their Gram matrix is the identity plus that little, so that each pass
//! d += sum n phi r, r = y - sum d phi gains about 14 digits: after the f64 solution one pass leaves 1e-28.
//! Plain f64 (of any method) has some nine digits on a problem like Wampler's, whose values outgrow its coefficients
//! by six orders of magnitude; a refinement of the residual alone stalls where the residuals are large, because the
//! basis, too, must be known to more digits.

use crate::dd::{Dd, dot};
use crate::orthogonal::Basis;
use crate::reduce::Row;

/// Most passes; each gains about 14 digits, fewer only on nearly dependent abscissae.
const MAX_PASSES: usize = 8;

/// A last correction below this part of the solution leaves less than 1e-24 of it.
const SETTLED: f64 = 1e-12;

/// A last correction below this part of the solution is rounding in double-double.
const CONVERGED: f64 = 1e-29;

/// The recurrence phi_{k+1} = gain_k ((t - alpha_k) phi_k - beta_{k-1} phi_{k-1}), all coefficients exact.
#[derive(Clone, Debug)]
pub(crate) struct Recurrence {
    pub alpha: Vec<f64>,
    pub beta: Vec<f64>,
    pub gain: Vec<f64>,
    /// phi_0.
    pub first: f64,
}

/// The solution in the polynomials of `recurrence`.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub recurrence: Recurrence,
    pub d: Vec<Dd>,
}

/// Solves for `order` at abscissae `t`, of which the basis knows the rounded values, from the f64 solution `start`.
///
/// `exact` asks for passes until nothing changes; otherwise they end as soon as what is left cannot be seen in f64.
pub(crate) fn solve(basis: &Basis, rows: &[Row], t: &[Dd], start: &[f64], order: usize, exact: bool) -> Solution {
    let recurrence = Recurrence {
        alpha: basis.alpha[..order].to_vec(),
        beta: basis.beta[..order].to_vec(),
        gain: basis.gain[..order].to_vec(),
        first: 1.0 / basis.weight.sqrt(),
    };
    let phi = values(&recurrence, t);
    let mut d: Vec<Dd> = start[..=order].iter().copied().map(Dd::from).collect();
    let mut residual: Vec<Dd> = rows.iter().map(|row| row.y).collect();
    let mut step = d.clone();
    let mut last = f64::INFINITY;
    for _ in 0..MAX_PASSES {
        for (phi, step) in phi.iter().zip(&step) {
            residual.iter_mut().zip(phi).for_each(|(r, phi)| *r = *r - *phi * *step);
        }
        let pull: Vec<Dd> = rows.iter().zip(&residual).map(|(row, r)| r.scale(row.n)).collect();
        step = phi.iter().map(|phi| dot(phi, &pull)).collect();
        let size = step.iter().map(|g| g.hi.abs()).fold(0.0, f64::max);
        if size.is_nan() || size >= last {
            break;
        }
        last = size;
        d.iter_mut().zip(&step).for_each(|(d, g)| *d = *d + *g);
        let scale = d.iter().map(|d| d.hi.abs()).fold(0.0, f64::max);
        if size <= scale * if exact { CONVERGED } else { SETTLED } {
            break;
        }
    }
    Solution { recurrence, d }
}

/// phi_k(t_r) for all k of the recurrence.
fn values(recurrence: &Recurrence, t: &[Dd]) -> Vec<Vec<Dd>> {
    let mut phi = vec![vec![Dd::from(recurrence.first); t.len()]];
    for (k, (alpha, gain)) in recurrence.alpha.iter().zip(&recurrence.gain).enumerate() {
        let alpha = Dd::from(-alpha);
        let next = if k == 0 {
            t.iter().zip(&phi[0]).map(|(t, phi)| ((*t + alpha) * *phi).scale(*gain)).collect()
        } else {
            let beta = recurrence.beta[k - 1];
            let earlier = t.iter().zip(&phi[k]).zip(&phi[k - 1]);
            earlier.map(|((t, phi), last)| ((*t + alpha) * *phi - last.scale(beta)).scale(*gain)).collect()
        };
        phi.push(next);
    }
    phi
}
