//! Double-double arithmetic: an unevaluated sum of two f64, about 32 decimal digits.
//!
//! Dekker (1971) and Knuth's error-free sums and products. The product splits its factors instead of using a fused
//! multiply-add: on a processor or build without FMA that is a library call, the split is the same everywhere.
//! Valid for magnitudes between about 1e-140 and 1e150, which the fits stay far inside.

use std::ops::{Add, Mul, Neg, Sub};

/// A number `hi + lo` with |lo| <= ulp(hi) / 2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dd {
    /// The number rounded to f64.
    pub hi: f64,
    /// What that rounding left out.
    pub lo: f64,
}

/// `a + b` and its rounding error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let v = s - a;
    (s, (a - (s - v)) + (b - v))
}

/// `a + b` and its rounding error where |a| >= |b| (Dekker).
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// `a` as two halves of 26 bits (Veltkamp).
fn split(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let c = SPLITTER * a;
    let hi = c - (c - a);
    (hi, a - hi)
}

/// `a * b` and its rounding error (Dekker).
fn two_prod(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

impl Dd {
    /// Zero.
    pub const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// The product with an f64.
    pub fn scale(self, b: f64) -> Self {
        let (p, e) = two_prod(self.hi, b);
        let (hi, lo) = quick_two_sum(p, e + self.lo * b);
        Self { hi, lo }
    }

    /// The quotient with an f64, good but for the last two bits.
    pub fn div_f64(self, b: f64) -> Self {
        let q1 = self.hi / b;
        let (p, e) = two_prod(q1, b);
        let rest = ((self.hi - p) - e) + self.lo;
        let (hi, lo) = quick_two_sum(q1, rest / b);
        Self { hi, lo }
    }
}

impl From<f64> for Dd {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

impl Add for Dd {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        let (s, e) = two_sum(self.hi, b.hi);
        let (t, f) = two_sum(self.lo, b.lo);
        let (s, e) = quick_two_sum(s, e + t);
        let (hi, lo) = quick_two_sum(s, e + f);
        Self { hi, lo }
    }
}

impl Neg for Dd {
    type Output = Self;
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for Dd {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Mul for Dd {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let (p, e) = two_prod(self.hi, b.hi);
        let (hi, lo) = quick_two_sum(p, e + (self.hi * b.lo + self.lo * b.hi));
        Self { hi, lo }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_third_has_thirty_two_digits() {
        let back = Dd::from(1.0).div_f64(3.0).scale(3.0) - Dd::from(1.0);
        assert!(back.hi.abs() < 1e-31, "{back:?}");
    }

    proptest! {
        #[test]
        fn products_of_integers_are_exact(a in -(1_i64 << 52)..(1_i64 << 52), b in -(1_i64 << 52)..(1_i64 << 52)) {
            let (p, e) = two_prod(a as f64, b as f64);
            prop_assert_eq!(p as i128 + e as i128, i128::from(a) * i128::from(b));
        }

        #[test]
        fn sums_are_exact(a in -(1_i64 << 52)..(1_i64 << 52), b in -(1_i64 << 20)..(1_i64 << 20)) {
            let s = Dd::from(a as f64 * 1024.0) + Dd::from(b as f64 / 4.0);
            prop_assert_eq!((s.hi * 4.0) as i128 + (s.lo * 4.0) as i128, i128::from(a) * 4096 + i128::from(b));
        }
    }
}
