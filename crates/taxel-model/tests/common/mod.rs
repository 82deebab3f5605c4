//! Exact rational least squares, the judge of every solver here.
#![allow(clippy::unwrap_used, clippy::expect_used)] // Tests; the exemption knows only functions marked as such.

use num_bigint::BigInt;
use num_rational::BigRational;
use taxel_model::{Dd, parse_decimal};

/// Zero and one, without a further crate for their traits.
pub fn int(n: i64) -> BigRational {
    BigRational::from_integer(BigInt::from(n))
}

pub fn exact(v: f64) -> BigRational {
    BigRational::from_float(v).expect("finite")
}

/// A decimal number, exactly.
pub fn decimal(text: &str) -> BigRational {
    let text = text.trim();
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().unwrap()),
        None => (text, 0),
    };
    let places = mantissa.find('.').map_or(0, |at| mantissa.len() - at - 1) as i32;
    let digits: BigInt = mantissa.replace('.', "").parse().unwrap();
    BigRational::from_integer(digits) * int(10).pow(exponent - places)
}

/// The coefficients, ascending, of the polynomial that minimises sum (y - p(x))^2.
pub fn least_squares(x: &[BigRational], y: &[BigRational], order: usize) -> Vec<BigRational> {
    let n = order + 1;
    let mut power: Vec<BigRational> = vec![int(1); x.len()];
    let mut sums = Vec::new();
    let mut right = Vec::new();
    for k in 0..=2 * order {
        sums.push(power.iter().fold(int(0), |s, p| s + p));
        if k <= order {
            right.push(power.iter().zip(y).fold(int(0), |s, (p, y)| s + p * y));
        }
        power = power.iter().zip(x).map(|(p, x)| p * x).collect();
    }
    let mut a: Vec<Vec<BigRational>> =
        (0..n).map(|i| (0..n).map(|j| sums[i + j].clone()).chain([right[i].clone()]).collect()).collect();
    for i in 0..n {
        let pivot = (i..n).find(|&r| a[r][i] != int(0)).expect("full rank");
        a.swap(i, pivot);
        for r in 0..n {
            if r != i && a[r][i] != int(0) {
                let factor = &a[r][i] / &a[i][i];
                let pivot = a[i].clone();
                a[r].iter_mut().zip(&pivot).skip(i).for_each(|(a, p)| *a -= &factor * p);
            }
        }
    }
    (0..n).map(|i| &a[i][n] / &a[i][i]).collect()
}

/// A rational as f64, good enough to compare sizes.
pub fn to_f64(r: &BigRational) -> f64 {
    // Long numerators overflow f64: keep 200 bits of each.
    let (n, d) = (r.numer(), r.denom());
    let cut = n.bits().min(d.bits()).saturating_sub(200);
    let short = |b: &BigInt| -> f64 { (b >> cut).to_string().parse().unwrap() };
    short(n) / short(d)
}

/// Correct digits of the worst coefficient (log relative error), 16 at most: all that an f64 holds.
pub fn correct_digits(got: &[f64], want: &[BigRational]) -> f64 {
    assert_eq!(got.len(), want.len());
    got.iter()
        .zip(want)
        .map(|(got, want)| {
            let error = to_f64(&(exact(*got) - want)).abs();
            let digits = if *want == int(0) { -error.log10() } else { -(error / to_f64(want).abs()).log10() };
            digits.min(16.0)
        })
        .fold(16.0, f64::min)
}

/// Columns of decimals as written, in high and low parts.
pub fn parts(text: &[&str]) -> (Vec<f64>, Vec<f64>) {
    text.iter().map(|t| parse_decimal(t).expect("a decimal")).map(|Dd { hi, lo }| (hi, lo)).unzip()
}
