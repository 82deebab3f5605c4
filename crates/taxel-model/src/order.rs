//! How well each order predicts what it has not seen.

use crate::orthogonal::{Basis, dot};
use serde::{Deserialize, Serialize};

/// An order is as good as the best if its PRESS is within this factor of it.
const TIE: f64 = 1.01;

/// A row with less than this part of its own prediction left is passed through by the curve: nothing is left to judge.
const MIN_REST: f64 = 1e-8;

/// The score of one order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderScore {
    /// Order of the polynomial.
    pub order: u8,
    /// Root of the mean leave-one-out square, kPa; `None` where a row determines itself.
    pub press_kpa: Option<f64>,
}

/// Scores of the orders 0.. of a basis. With `z` = sqrt(n) y and `d` its projection,
/// PRESS = sum (e_r / (1 - H_r))^2, e_r the weighted residual and H_r the leverage of row r (Allen 1974). A row is
/// a distinct count or a pressure bin, so that samples of one count do not vouch for each other.
pub(crate) fn press_by_order(basis: &Basis, z: &[f64], d: &[f64]) -> Vec<OrderScore> {
    let mut residual = z.to_vec();
    let mut rest = vec![1.0; z.len()];
    let mut deleted = vec![0.0; z.len()];
    basis
        .vectors
        .iter()
        .zip(d)
        .enumerate()
        .map(|(order, (q, d))| {
            for (((e, rest), deleted), q) in residual.iter_mut().zip(&mut rest).zip(&mut deleted).zip(q) {
                *e -= d * q;
                *rest -= q * q;
                *deleted = *e / *rest;
            }
            let determined = rest.iter().any(|rest| *rest < MIN_REST);
            let press = dot(&deleted, &deleted);
            let press_kpa = (!determined).then(|| (press / basis.weight).sqrt()).filter(|p| p.is_finite());
            OrderScore { order: order as u8, press_kpa }
        })
        .collect()
}

/// The smallest order, 1 at least, whose PRESS is within 1 % of the least; 1 if none has a score.
pub(crate) fn choose(scores: &[OrderScore]) -> usize {
    let press = |score: &OrderScore| score.press_kpa.map(|p| p * p);
    let best = scores.iter().skip(1).filter_map(press).fold(f64::INFINITY, f64::min);
    let good = scores.iter().skip(1).find(|score| press(score).is_some_and(|p| p <= TIE * best));
    good.map_or(1, |score| usize::from(score.order))
}
