//! The polynomial sets of NIST's Statistical Reference Datasets, as decimals.

use crate::reference::{Reference, to_f64};
use anyhow::{Context as _, ensure};
use num_bigint::BigInt;
use num_rational::BigRational;
use std::path::Path;

/// A regression set and its exact solution.
pub(super) struct Set {
    pub name: String,
    pub order: usize,
    /// Decimals as written.
    pub x: Vec<String>,
    pub y: Vec<String>,
    /// The exact least-squares coefficients of the decimals as written, ascending.
    pub exact: Vec<BigRational>,
    /// NIST's certified coefficients, where their file is at hand.
    pub certified: Option<Vec<f64>>,
}

/// Disturbance of Wampler's third to fifth set.
const DELTA: [i64; 21] = [
    759, -2048, 2048, -2048, 2523, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 2523, -2048,
    2048, -2048, 759,
];

/// Filip's set has no definition to compute it from; the data are in the public domain and in the tests of the model.
const FILIP: &str = include_str!("../../../taxel-model/tests/filip.csv");

/// All sets that are at hand: those with a definition always, others from `folder`.
pub(super) fn all(folder: Option<&Path>) -> anyhow::Result<Vec<Set>> {
    let mut sets = Vec::new();
    for (name, order) in [("norris", 1), ("pontius", 2)] {
        let Some(text) = folder.and_then(|folder| std::fs::read_to_string(folder.join(format!("{name}.csv"))).ok())
        else {
            continue;
        };
        let (x, y) = columns(&text).with_context(|| format!("{name}.csv"))?;
        sets.push(Set::new(name, order, x, y, folder)?);
    }
    for number in 1..=5 {
        let (x, y) = wampler(number);
        let name = format!("wampler{number}");
        if let Some(text) = folder.and_then(|folder| std::fs::read_to_string(folder.join(format!("{name}.csv"))).ok()) {
            let (file_x, file_y) = columns(&text)?;
            let same = integers(&file_x)? == integers(&x)? && integers(&file_y)? == integers(&y)?;
            ensure!(same, "{name}.csv differs from the set's published definition");
        }
        sets.push(Set::new(&name, 5, x, y, folder)?);
    }
    let (x, y) = columns(FILIP).context("filip.csv")?;
    sets.push(Set::new("filip", 10, x, y, folder)?);
    Ok(sets)
}

impl Set {
    fn new(name: &str, order: usize, x: Vec<String>, y: Vec<String>, folder: Option<&Path>) -> anyhow::Result<Self> {
        let exact = solve(&x, &y, order).with_context(|| format!("{name} has no solution of order {order}"))?;
        let certified =
            folder.and_then(|folder| std::fs::read_to_string(folder.join(format!("{name}.certified.csv"))).ok());
        let value = |line: &str| line.split(',').nth(1).and_then(|value| value.parse().ok());
        let certified = certified.and_then(|text| text.lines().skip(1).map(value).collect::<Option<Vec<f64>>>());
        Ok(Self { name: name.to_owned(), order, x, y, exact, certified })
    }

    /// The decimals as the nearest f64.
    pub fn rounded(&self) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
        let floats = |texts: &[String]| texts.iter().map(|text| text.parse()).collect::<Result<Vec<f64>, _>>();
        Ok((floats(&self.x)?, floats(&self.y)?))
    }
}

/// y = 1 + x + .. + x^5 or its relatives, at x = 0..20.
fn wampler(number: u32) -> (Vec<String>, Vec<String>) {
    let sum = |x: i64| (0..6).map(|k| x.pow(k)).sum::<i64>();
    let y = |x: i64| match number {
        1 => sum(x).to_string(),
        // Sum of (x / 10)^k: a whole number of 10^-5.
        2 => {
            let parts: i64 = (0..6).map(|k| x.pow(k) * 10_i64.pow(5 - k)).sum();
            format!("{}.{:05}", parts / 100_000, parts % 100_000)
        }
        _ => (sum(x) + 100_i64.pow(number - 3) * DELTA[x as usize]).to_string(),
    };
    ((0..21).map(|x| x.to_string()).collect(), (0..21).map(y).collect())
}

fn columns(text: &str) -> anyhow::Result<(Vec<String>, Vec<String>)> {
    let pair = |line: &str| line.split_once(',').map(|(x, y)| (x.trim().to_owned(), y.trim().to_owned()));
    text.lines().skip(1).map(pair).collect::<Option<_>>().context("a line is not of the form x,y")
}

/// Decimals without exponent as integers times one power of ten, and how many places that power has.
fn integers(texts: &[String]) -> anyhow::Result<(Vec<f64>, u32)> {
    let places_of = |text: &str| text.split_once('.').map_or(0, |(_, fraction)| fraction.trim_end_matches('0').len());
    let places = texts.iter().map(|text| places_of(text)).max().unwrap_or(0);
    let integer = |text: &String| -> anyhow::Result<f64> {
        let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
        let digits = format!("{whole}{:0<places$}", fraction.trim_end_matches('0'));
        let value: i64 = digits.parse().with_context(|| format!("`{text}` is not a plain decimal"))?;
        ensure!(value.unsigned_abs() < 1 << 53, "`{text}` has more digits than an f64 holds");
        Ok(value as f64)
    };
    Ok((texts.iter().map(integer).collect::<anyhow::Result<_>>()?, places as u32))
}

/// The exact coefficients for the decimals as written: solved in integers, then scaled back.
fn solve(x: &[String], y: &[String], order: usize) -> anyhow::Result<Vec<BigRational>> {
    let ((x, x_places), (y, y_places)) = (integers(x)?, integers(y)?);
    let solution = Reference::fit(&x, &y, None, order).context("the abscissae carry no such order")?;
    let ten = BigRational::from_integer(BigInt::from(10));
    let scaled = |(k, c): (usize, BigRational)| c * ten.pow(x_places as i32 * k as i32 - y_places as i32);
    Ok(solution.coefficients().into_iter().enumerate().map(scaled).collect())
}

/// Correct digits of the worst coefficient (log relative error), 0 to 16: an f64 holds no more.
pub(super) fn correct_digits(got: &[f64], exact: &[BigRational]) -> Option<f64> {
    if got.len() != exact.len() {
        return None;
    }
    let digits = got.iter().zip(exact).map(|(got, want)| {
        let error = to_f64(&((crate::reference::exact(*got)? - want) / want)).abs();
        Some((-error.log10()).clamp(0.0, 16.0))
    });
    digits.collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wamplers_sets_have_their_certified_coefficients() {
        let sets = all(None).unwrap();
        let names: Vec<&str> = sets.iter().map(|set| set.name.as_str()).collect();
        assert_eq!(names, ["wampler1", "wampler2", "wampler3", "wampler4", "wampler5", "filip"]);
        for set in &sets[..5] {
            let base = if set.name == "wampler2" { 10 } else { 1 };
            for (k, c) in set.exact.iter().enumerate() {
                assert_eq!(*c, BigRational::new(BigInt::from(1), BigInt::from(base).pow(k as u32)), "{}", set.name);
            }
        }
        assert_eq!(sets[1].y[..3], ["1.00000", "1.11111", "1.24992"]);
    }

    #[test]
    fn filips_first_and_last_certified_coefficients() {
        let filip = all(None).unwrap().pop().unwrap();
        let ends = [to_f64(&filip.exact[0]), to_f64(&filip.exact[10])];
        for (got, certified) in ends.iter().zip([-1_467.489_614_229_8, -4.029_625_250_804_04e-5]) {
            assert!(((got - certified) / certified).abs() < 1e-14, "{got} {certified}");
        }
    }

    #[test]
    fn decimals_are_exact_integers() {
        let texts = ["0.2", "-12.345", "7"].map(str::to_owned);
        assert_eq!(integers(&texts).unwrap(), (vec![200.0, -12_345.0, 7000.0], 3));
        assert_eq!(integers(&["-0.5".to_owned()]).unwrap().0, [-5.0]);
        assert!(integers(&["1e5".to_owned()]).is_err());
    }

    #[test]
    fn digits_of_the_worst_coefficient() {
        let exact = [1, 3].map(|n| BigRational::new(BigInt::from(n), BigInt::from(1)));
        assert_eq!(correct_digits(&[1.0, 3.0], &exact), Some(16.0));
        let digits = correct_digits(&[1.0, 3.003], &exact).unwrap();
        assert!((digits - 3.0).abs() < 1e-3, "{digits}");
        assert_eq!(correct_digits(&[1.0, -1e9], &exact), Some(0.0));
        assert_eq!(correct_digits(&[1.0], &exact), None);
    }
}
