//! Polynomials in double-double, and the changes of basis between the forms in which a curve is solved, served
//! and printed. Orders are small (10 at most), so the plain O(p^2) recurrences do.

use crate::dd::Dd;
use crate::options::MAX_ORDER;
use crate::refine::Solution;

/// Coefficients of T_0 .. T_p in s.
pub(crate) type Chebyshev = Vec<Dd>;

/// Coefficients of 1, s, s^2, ...
pub(crate) type Powers = Vec<Dd>;

/// s times a Chebyshev series: s T_0 = T_1, s T_k = (T_{k+1} + T_{k-1}) / 2.
fn times_s(series: &[Dd]) -> Chebyshev {
    let mut out = vec![Dd::ZERO; series.len() + 1];
    for (k, c) in series.iter().enumerate() {
        if k == 0 {
            out[1] = out[1] + *c;
        } else {
            let half = c.scale_exact(0.5);
            out[k + 1] = out[k + 1] + half;
            out[k - 1] = out[k - 1] + half;
        }
    }
    out
}

/// The least-squares solution as a Chebyshev series in s, where t = ratio s.
pub(crate) fn chebyshev_of(solution: &Solution, ratio: f64) -> Chebyshev {
    let recurrence = &solution.recurrence;
    let mut last: Chebyshev = Vec::new();
    let mut phi: Chebyshev = vec![Dd::from(1.0)];
    let mut sum = vec![Dd::ZERO; solution.d.len()];
    for (k, d) in solution.d.iter().enumerate() {
        sum.iter_mut().zip(&phi).for_each(|(sum, c)| *sum = *sum + *c * *d);
        let (Some(alpha), Some(gamma)) = (recurrence.alpha.get(k), recurrence.gamma.get(k)) else { break };
        let mut next: Chebyshev = times_s(&phi).iter().map(|c| c.scale(ratio)).collect();
        next.iter_mut().zip(&phi).for_each(|(next, c)| *next = *next - c.scale(*alpha));
        next.iter_mut().zip(&last).for_each(|(next, c)| *next = *next - c.scale(*gamma));
        last = std::mem::replace(&mut phi, next);
    }
    sum
}

/// Powers of s of a Chebyshev series.
pub(crate) fn powers_of(series: &[Dd]) -> Powers {
    let mut sum = vec![Dd::ZERO; series.len()];
    let (mut last, mut t) = ([0.0; MAX_ORDER as usize + 1], [0.0; MAX_ORDER as usize + 1]);
    t[0] = 1.0;
    for (k, c) in series.iter().enumerate() {
        for (sum, t) in sum.iter_mut().zip(&t).filter(|(_, t)| **t != 0.0) {
            *sum = *sum + c.scale(*t);
        }
        // T_1 = s, T_{k+1} = 2 s T_k - T_{k-1}; the coefficients are small integers.
        let factor = if k == 0 { 1.0 } else { 2.0 };
        let mut next = [0.0; MAX_ORDER as usize + 1];
        for j in 0..=(k + 1).min(MAX_ORDER as usize) {
            let shifted = if j == 0 { 0.0 } else { factor * t[j - 1] };
            next[j] = shifted - if k == 0 { 0.0 } else { last[j] };
        }
        last = std::mem::replace(&mut t, next);
    }
    sum
}

/// A Chebyshev series of powers of s, by Horner's rule.
#[cfg(test)]
pub(crate) fn chebyshev_of_powers(powers: &[Dd]) -> Chebyshev {
    let mut series: Chebyshev = Vec::new();
    for c in powers.iter().rev() {
        if series.is_empty() {
            series.push(*c);
        } else {
            series = times_s(&series);
            series[0] = series[0] + *c;
        }
    }
    series
}

/// The coefficients in x of sum a_k ((x - centre) / half)^k.
pub(crate) fn powers_of_raw(powers: &[Dd], centre: f64, half: f64) -> Powers {
    let mut a = powers.to_vec();
    for k in 1..a.len() {
        a[k..].iter_mut().for_each(|a| *a = a.div_f64(half));
    }
    shift(&mut a, Dd::from(-centre));
    a
}

/// p(x) -> p(x + by), by repeated synthetic division.
fn shift(a: &mut [Dd], by: Dd) {
    for i in 0..a.len() {
        for j in (i..a.len().saturating_sub(1)).rev() {
            a[j] = a[j] + a[j + 1] * by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(powers: &[Dd], x: f64) -> f64 {
        powers.iter().rev().fold(Dd::ZERO, |sum, c| sum.scale(x) + *c).hi
    }

    proptest! {
        #[test]
        fn every_change_of_basis_keeps_the_polynomial(
            c in proptest::collection::vec(-9.0..9.0_f64, 1..11),
        ) {
            let powers: Vec<Dd> = c.iter().copied().map(Dd::from).collect();
            let back = powers_of(&chebyshev_of_powers(&powers));
            for k in 0..c.len() {
                prop_assert!((back[k] - powers[k]).hi.abs() < 1e-27, "chebyshev {k}");
            }
            let raw = powers_of_raw(&powers, 200.0, 32.0);
            prop_assert!((at(&raw, 216.0) - at(&powers, 0.5)).abs() <= 1e-12);
        }
    }
}
