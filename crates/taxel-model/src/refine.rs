//! The least-squares solution to double-double accuracy at a small multiple of the f64 cost.
//!
//! The f64 recurrence coefficients are taken as exact numbers: they define polynomials that are orthogonal up to about
//! 1e-14. Evaluated in double-double, their Gram matrix is diagonal up to that little, so that each pass
//! d += norm^2 sum n phi r, r = y - sum d phi gains about 14 digits: after the f64 solution one pass leaves 1e-28.
//! Plain f64 (of any method) has some nine digits on a problem like Wampler's, whose values outgrow its coefficients
//! by six orders of magnitude; a refinement of the residual alone stalls where the residuals are large, because the
//! basis, too, must be known to more digits.

use crate::dd::Dd;
use crate::orthogonal::Basis;
use crate::samples::Row;

/// Most passes; each gains about 14 digits, fewer only on nearly dependent abscissae.
const MAX_PASSES: usize = 8;

/// A last correction below this part of the solution leaves less than 1e-24 of it: nothing that can be seen in f64.
const SETTLED: f64 = 1e-12;

/// The monic recurrence phi_0 = 1, phi_{k+1} = (t - alpha_k) phi_k - gamma_k phi_{k-1}, all coefficients exact.
#[derive(Clone, Debug)]
pub(crate) struct Recurrence {
    pub alpha: Vec<f64>,
    /// The square of the basis's beta_{k-1}; 0 for k = 0.
    pub gamma: Vec<f64>,
}

/// The solution in the polynomials of `recurrence`.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub recurrence: Recurrence,
    pub d: Vec<Dd>,
}

/// Solves for `order` at abscissae `t`, of which the basis knows the rounded values, from the f64 solution `start`.
pub(crate) fn solve(basis: &Basis, rows: &[Row], t: &[Dd], start: &[f64], order: usize) -> Solution {
    let earlier = std::iter::once(0.0).chain(basis.beta.iter().copied());
    let recurrence =
        Recurrence { alpha: basis.alpha[..order].to_vec(), gamma: earlier.take(order).map(|b| b * b).collect() };
    // norm[k] phi_k has unit length.
    let norm: Vec<f64> = std::iter::successors(Some((0, 1.0 / basis.weight.sqrt())), |(k, norm)| {
        basis.beta.get(*k).map(|beta| (k + 1, norm / beta))
    })
    .map(|(_, norm)| norm)
    .collect();
    let mut d: Vec<Dd> = start.iter().zip(&norm).take(order + 1).map(|(d, norm)| Dd::from(d * norm)).collect();
    let mut last = f64::INFINITY;
    for _ in 0..MAX_PASSES {
        let step: Vec<Dd> = pull(&recurrence, rows, t, &d).iter().zip(&norm).map(|(g, norm)| g.scale(*norm)).collect();
        let size = step.iter().map(|g| g.hi.abs()).fold(0.0, f64::max);
        if size.is_nan() || size >= last {
            break;
        }
        last = size;
        d.iter_mut().zip(&step).zip(&norm).for_each(|((d, g), norm)| *d = *d + g.scale(*norm));
        let scale = d.iter().zip(&norm).map(|(d, norm)| (d.hi / norm).abs()).fold(0.0, f64::max);
        if size <= scale * SETTLED {
            break;
        }
    }
    Solution { recurrence, d }
}

/// sum n phi_k r of the residuals r = y - sum d phi, for all k.
fn pull(recurrence: &Recurrence, rows: &[Row], t: &[Dd], d: &[Dd]) -> Vec<Dd> {
    let (mut pull, mut phi) = (vec![Dd::ZERO; d.len()], vec![Dd::ZERO; d.len()]);
    phi[0] = Dd::from(1.0);
    for (row, t) in rows.iter().zip(t) {
        for (k, (alpha, gamma)) in recurrence.alpha.iter().zip(&recurrence.gamma).enumerate() {
            phi[k + 1] = (*t - Dd::from(*alpha)) * phi[k] - phi[k.saturating_sub(1)].scale(*gamma);
        }
        let rest = d.iter().zip(&phi).fold(row.y, |rest, (d, phi)| rest - *d * *phi);
        let weighted = rest.scale(row.n);
        pull.iter_mut().zip(&phi).for_each(|(pull, phi)| *pull = *pull + *phi * weighted);
    }
    pull
}
