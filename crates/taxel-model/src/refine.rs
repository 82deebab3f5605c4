//! The least-squares solution to double-double accuracy at a small multiple of the f64 cost.
//!
//! The f64 recurrence coefficients are taken as exact numbers: they define polynomials that are orthogonal up to about
//! 1e-14. Evaluated in double-double, their Gram matrix is diagonal up to that little, so that each pass
//! d += norm^2 sum n phi r, r = y - sum d phi gains about 14 digits: after the f64 solution one pass leaves 1e-28.
//! Plain f64 (of any method) has some nine digits on a problem like Wampler's, whose values outgrow its coefficients
//! by six orders of magnitude; a refinement of the residual alone stalls where the residuals are large, because the
//! basis, too, must be known to more digits.

use crate::dd::{Dd, Running};
use crate::options::MAX_ORDER;
use crate::orthogonal::Basis;
use crate::reduce::Row;

/// Most passes; each gains about 14 digits, fewer only on nearly dependent abscissae.
const MAX_PASSES: usize = 8;

/// A last correction below this part of the solution leaves less than 1e-24 of it: nothing that can be seen in f64.
const SETTLED: f64 = 1e-12;

/// Rows that are worked on together: enough to fill the processor's vectors, few enough to stay in its first cache.
const LANES: usize = 16;

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
        basis.gain.get(*k).map(|gain| (k + 1, norm * gain))
    })
    .map(|(_, norm)| norm)
    .collect();
    let blocks = Block::of(rows, t);
    let mut d: Vec<Dd> = start.iter().zip(&norm).take(order + 1).map(|(d, norm)| Dd::from(d * norm)).collect();
    let mut last = f64::INFINITY;
    for _ in 0..MAX_PASSES {
        let step: Vec<Dd> = pull(&recurrence, &blocks, &d).iter().zip(&norm).map(|(g, norm)| g.scale(*norm)).collect();
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

/// One number of each row of a block, the parts apart so that the compiler works on several rows at once.
#[derive(Clone, Copy)]
struct Lanes {
    hi: [f64; LANES],
    lo: [f64; LANES],
}

impl Lanes {
    const ZERO: Self = Self { hi: [0.0; LANES], lo: [0.0; LANES] };

    #[inline]
    fn get(&self, lane: usize) -> Dd {
        Dd { hi: self.hi[lane], lo: self.lo[lane] }
    }

    /// Changes what is no number but a running sum.
    #[inline]
    fn run(&mut self, lane: usize, change: impl FnOnce(Running) -> Running) {
        let Running { sum, error } = change(Running { sum: self.hi[lane], error: self.lo[lane] });
        (self.hi[lane], self.lo[lane]) = (sum, error);
    }

    #[inline]
    fn set(&mut self, lane: usize, value: Dd) {
        self.hi[lane] = value.hi;
        self.lo[lane] = value.lo;
    }
}

/// Some rows; lanes beyond the last row have no weight.
struct Block {
    t: Lanes,
    y: Lanes,
    n: [f64; LANES],
}

impl Block {
    fn of(rows: &[Row], t: &[Dd]) -> Vec<Self> {
        let fill = |(rows, t): (&[Row], &[Dd])| {
            let mut block = Self { t: Lanes::ZERO, y: Lanes::ZERO, n: [0.0; LANES] };
            for (lane, (row, t)) in rows.iter().zip(t).enumerate() {
                block.t.set(lane, *t);
                block.y.set(lane, row.y);
                block.n[lane] = row.n;
            }
            block
        };
        rows.chunks(LANES).zip(t.chunks(LANES)).map(fill).collect()
    }
}

/// sum n phi_k r of the residuals r = y - sum d phi, for all k.
fn pull(recurrence: &Recurrence, blocks: &[Block], d: &[Dd]) -> Vec<Dd> {
    let mut pull = [Lanes::ZERO; MAX_ORDER as usize + 1];
    let mut phi = [Lanes::ZERO; MAX_ORDER as usize + 1];
    phi[0].hi = [1.0; LANES];
    for block in blocks {
        for (k, (alpha, gamma)) in recurrence.alpha.iter().zip(&recurrence.gamma).enumerate() {
            let (known, next) = phi.split_at_mut(k + 1);
            let (phi, last) = (&known[k], &known[k.saturating_sub(1)]);
            for lane in 0..LANES {
                let t = block.t.get(lane).add_f64(-alpha);
                let sum = Running::default().add_product(t, phi.get(lane)).add_scaled(last.get(lane), -gamma);
                next[0].set(lane, sum.value());
            }
        }
        let mut rest = block.y;
        for (d, phi) in d.iter().zip(&phi) {
            for lane in 0..LANES {
                rest.run(lane, |rest| rest.add_product(phi.get(lane), -*d));
            }
        }
        for lane in 0..LANES {
            let weighted = Running { sum: rest.hi[lane], error: rest.lo[lane] }.value().scale(block.n[lane]);
            rest.set(lane, weighted);
        }
        for (pull, phi) in pull.iter_mut().zip(&phi).take(d.len()) {
            for lane in 0..LANES {
                pull.run(lane, |pull| pull.add_product(phi.get(lane), rest.get(lane)));
            }
        }
    }
    let total = |pull: &Lanes| (0..LANES).fold(Dd::ZERO, |sum, lane| sum + Dd::sum(pull.hi[lane], pull.lo[lane]));
    pull[..d.len()].iter().map(total).collect()
}
