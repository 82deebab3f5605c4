//! The polynomial sets of NIST's Statistical Reference Datasets, as decimals, with their exact solutions.

use super::parse_decimal;
use super::reference::{decimal, least_squares};
use crate::dd::Dd;
use num_rational::BigRational;

/// A regression set and its exact solution.
pub struct Set {
    /// As NIST has it, in lower case.
    pub name: String,
    /// Of the polynomial.
    pub order: usize,
    /// Decimals as written.
    x: Vec<String>,
    y: Vec<String>,
    /// The exact least-squares coefficients of the decimals as written, ascending.
    pub exact: Vec<BigRational>,
}

/// Values in two parts, high and low.
pub type Parts = (Vec<f64>, Vec<f64>);

/// Disturbance of Wampler's third to fifth set.
const DELTA: [i64; 21] = [
    759, -2048, 2048, -2048, 2523, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 2523, -2048,
    2048, -2048, 759,
];

/// Filip's set has no definition to compute it from; the data are in the public domain.
const FILIP: &str = include_str!("../../tests/filip.csv");

/// The sets that need no file: Wampler's five and Filip's.
#[must_use]
pub fn built_in() -> Vec<Set> {
    let wampler = |number| {
        let (x, y) = (0..21).map(|x: i64| (x.to_string(), wampler(number, x))).unzip();
        Set::new(&format!("wampler{number}"), 5, x, y)
    };
    (1..=5).map(wampler).chain([Set::parse("filip", 10, FILIP)]).flatten().collect()
}

/// y = 1 + x + .. + x^5 or its relatives.
fn wampler(number: u32, x: i64) -> String {
    let sum = (0..6).map(|k| x.pow(k)).sum::<i64>();
    match number {
        1 => sum.to_string(),
        // Sum of (x / 10)^k: a whole number of 10^-5.
        2 => {
            let parts: i64 = (0..6).map(|k| x.pow(k) * 10_i64.pow(5 - k)).sum();
            format!("{}.{:05}", parts / 100_000, parts % 100_000)
        }
        _ => (sum + 100_i64.pow(number - 3) * DELTA[x as usize]).to_string(),
    }
}

impl Set {
    fn new(name: &str, order: usize, x: Vec<String>, y: Vec<String>) -> Option<Self> {
        let rational = |texts: &[String]| texts.iter().map(|text| decimal(text)).collect::<Option<Vec<_>>>();
        let exact = least_squares(&rational(&x)?, &rational(&y)?, order)?;
        Some(Self { name: name.to_owned(), order, x, y, exact })
    }

    /// From lines `x,y` after a header; `None` if a line is none, or the abscissae carry no such order.
    #[must_use]
    pub fn parse(name: &str, order: usize, text: &str) -> Option<Self> {
        let pair = |line: &str| line.split_once(',').map(|(x, y)| (x.trim().to_owned(), y.trim().to_owned()));
        let (x, y) = text.lines().skip(1).map(pair).collect::<Option<Vec<_>>>()?.into_iter().unzip();
        Self::new(name, order, x, y)
    }

    /// x and y to about 30 digits; the high parts are the decimals rounded to f64.
    #[must_use]
    pub fn parts(&self) -> (Parts, Parts) {
        let parts =
            |texts: &[String]| texts.iter().filter_map(|t| parse_decimal(t)).map(|Dd { hi, lo }| (hi, lo)).unzip();
        (parts(&self.x), parts(&self.y))
    }
}

#[cfg(test)]
mod tests {
    use super::super::reference::{integer, to_f64};
    use super::*;

    #[test]
    fn wamplers_sets_have_their_certified_coefficients() {
        let sets = built_in();
        let names: Vec<&str> = sets.iter().map(|set| set.name.as_str()).collect();
        assert_eq!(names, ["wampler1", "wampler2", "wampler3", "wampler4", "wampler5", "filip"]);
        for set in &sets[..5] {
            let base = integer(if set.name == "wampler2" { 10 } else { 1 });
            for (k, c) in set.exact.iter().enumerate() {
                assert_eq!(*c, base.pow(-(k as i32)), "{}", set.name);
            }
        }
        assert_eq!(sets[1].y[..3], ["1.00000", "1.11111", "1.24992"]);
    }

    /// Filip's certified coefficients, of order ten.
    const CERTIFIED: [&str; 11] = [
        "-1467.48961422980",
        "-2772.17959193342",
        "-2316.37108160893",
        "-1127.97394098372",
        "-354.478233703349",
        "-75.1242017393757",
        "-10.8753180355343",
        "-1.06221498588947",
        "-0.670191154593408E-01",
        "-0.246781078275479E-02",
        "-0.402962525080404E-04",
    ];

    #[test]
    fn the_data_of_the_last_set_are_filips() {
        let filip = built_in().pop().unwrap();
        for (got, certified) in filip.exact.iter().zip(CERTIFIED) {
            let certified = decimal(certified).unwrap();
            assert!(to_f64(&((got - &certified) / &certified)).abs() < 1e-14, "{}", to_f64(got));
        }
    }
}
