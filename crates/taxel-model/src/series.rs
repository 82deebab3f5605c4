//! Polynomials in double-double: from the basis in which a curve is solved to the forms in which it is served and
//! printed. Orders are small (10 at most), so the plain O(p^2) recurrences do.

use crate::dd::Dd;
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
            let half = c.scale(0.5);
            out[k + 1] = out[k + 1] + half;
            out[k - 1] = out[k - 1] + half;
        }
    }
    out
}

/// s times a series of powers of s.
fn times_s_of_powers(powers: &[Dd]) -> Powers {
    std::iter::once(Dd::ZERO).chain(powers.iter().copied()).collect()
}

/// The least-squares solution as a series in s, where t = ratio s and `times_s` multiplies a series by s.
fn series_of(solution: &Solution, ratio: f64, times_s: fn(&[Dd]) -> Vec<Dd>) -> Vec<Dd> {
    let recurrence = &solution.recurrence;
    let mut last = Vec::new();
    let mut phi = vec![Dd::from(1.0)];
    let mut sum = vec![Dd::ZERO; solution.d.len()];
    for (k, d) in solution.d.iter().enumerate() {
        sum.iter_mut().zip(&phi).for_each(|(sum, c)| *sum = *sum + *c * *d);
        let (Some(alpha), Some(gamma)) = (recurrence.alpha.get(k), recurrence.gamma.get(k)) else { break };
        let mut next: Vec<Dd> = times_s(&phi).iter().map(|c| c.scale(ratio)).collect();
        next.iter_mut().zip(&phi).for_each(|(next, c)| *next = *next - c.scale(*alpha));
        next.iter_mut().zip(&last).for_each(|(next, c): (&mut Dd, &Dd)| *next = *next - c.scale(*gamma));
        last = std::mem::replace(&mut phi, next);
    }
    sum
}

/// The least-squares solution as a Chebyshev series in s, where t = ratio s.
pub(crate) fn chebyshev_of(solution: &Solution, ratio: f64) -> Chebyshev {
    series_of(solution, ratio, times_s)
}

/// The least-squares solution in powers of the raw count, where t = (count - centre) / scale, each coefficient correctly rounded;
/// none if one of them is beyond f64.
pub(crate) fn raw_powers_of(solution: &Solution, scale: f64, centre: f64) -> Vec<f64> {
    let mut powers = series_of(solution, 1.0, times_s_of_powers);
    for k in 1..powers.len() {
        powers[k..].iter_mut().for_each(|a| *a = a.div_f64(scale));
    }
    shift(&mut powers, Dd::from(-centre));
    let raw: Vec<f64> = powers.iter().map(|c| c.hi).collect();
    if raw.iter().all(|c| c.is_finite()) { raw } else { Vec::new() }
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
    use crate::refine::Recurrence;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_change_of_basis_keeps_the_polynomial(
            d in proptest::collection::vec(-9.0..9.0_f64, 1..11), alpha in proptest::array::uniform10(-0.5..0.5_f64),
            gamma in proptest::array::uniform10(0.1..0.4_f64),
        ) {
            let order = d.len() - 1;
            let recurrence = Recurrence { alpha: alpha[..order].to_vec(), gamma: gamma[..order].to_vec() };
            let solution = Solution { recurrence, d: d.iter().copied().map(Dd::from).collect() };
            // T_k at s = 1/2.
            let t = [1.0, 0.5, -0.5, -1.0, -0.5, 0.5];
            let of_chebyshev = chebyshev_of(&solution, 0.75)
                .iter()
                .enumerate()
                .fold(Dd::ZERO, |sum, (k, c)| sum + c.scale(t[k % 6]));
            let powers = series_of(&solution, 0.75, times_s_of_powers);
            let of_powers = powers.iter().rev().fold(Dd::ZERO, |sum, c| sum.scale(0.5) + *c);
            prop_assert!((of_chebyshev - of_powers).hi.abs() < 1e-27, "{of_chebyshev:?} {of_powers:?}");
            // t = 3/8 at count 212.
            let raw = raw_powers_of(&solution, 32.0, 200.0);
            let at_212 = raw.iter().rev().fold(Dd::ZERO, |sum, c| sum.scale(212.0) + Dd::from(*c)).hi;
            let size = raw.iter().rev().fold(0.0, |sum, c| sum * 212.0 + c.abs());
            prop_assert!((at_212 - of_powers.hi).abs() <= f64::EPSILON * size, "{at_212} {of_powers:?}");
        }
    }
}
