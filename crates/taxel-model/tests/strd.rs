//! NIST's Statistical Reference Datasets that are polynomials: every digit that an f64 can hold.
#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

use std::path::PathBuf;
use taxel_model::stability::reference::{Reference, to_f64};
use taxel_model::{FitOptions, Samples, fit};

/// A regression set: its name, the order of its polynomial, x and y, and the certified coefficients, ascending.
struct Set {
    name: String,
    order: usize,
    x: Vec<f64>,
    y: Vec<f64>,
    certified: Vec<f64>,
}

/// Disturbance of Wampler's third to fifth set.
const DELTA: [f64; 21] = [
    759.0, -2048.0, 2048.0, -2048.0, 2523.0, -2048.0, 2048.0, -2048.0, 1838.0, -2048.0, 2048.0, -2048.0, 1838.0,
    -2048.0, 2048.0, -2048.0, 2523.0, -2048.0, 2048.0, -2048.0, 759.0,
];

/// Filip's set has no definition to compute it from; the data are in the public domain.
const FILIP: &str = include_str!("filip.csv");
const OF_FILIP: [f64; 11] = [
    -1_467.489_614_229_80,
    -2_772.179_591_933_42,
    -2_316.371_081_608_93,
    -1_127.973_940_983_72,
    -354.478_233_703_349,
    -75.124_201_739_375_7,
    -10.875_318_035_534_3,
    -1.062_214_985_889_47,
    -0.067_019_115_459_340_8,
    -0.002_467_810_782_754_79,
    -0.000_040_296_252_508_040_4,
];

/// 1 + x + .. + x^5, the same of x / 10, and the first one disturbed by 1, 100 and 10,000 times so much.
fn wampler(number: i32) -> Set {
    let base = if number == 2 { 0.1 } else { 1.0_f64 };
    let disturbed = if number > 2 { 100.0_f64.powi(number - 3) } else { 0.0 };
    let value = |(x, delta): (u32, f64)| (0..6).map(|k| (base * f64::from(x)).powi(k)).sum::<f64>() + disturbed * delta;
    Set {
        name: format!("wampler{number}"),
        order: 5,
        x: (0..21).map(f64::from).collect(),
        // Five decimals, as NIST prints them.
        y: (0..).zip(DELTA).map(value).map(|y| format!("{y:.5}").parse().unwrap()).collect(),
        certified: (0..6).map(|k| base.powi(k)).collect(),
    }
}

impl Set {
    /// From lines `x,y` after a header.
    fn parse(name: &str, order: usize, text: &str, certified: Vec<f64>) -> Self {
        let number = |text: &str| text.trim().parse::<f64>().unwrap();
        let pair = |line: &str| line.split_once(',').map(|(x, y)| (number(x), number(y))).unwrap();
        let (x, y) = text.lines().skip(1).map(pair).unzip();
        Self { name: name.to_owned(), order, x, y, certified }
    }

    /// All digits against the exact solution for these f64, and as many against the certified one as rounding the decimals
    /// to f64 leaves.
    fn check(&self) {
        let options = FitOptions { order: self.order as u8, ..FitOptions::default() };
        let got = fit(&Samples::new(&self.x, &self.y), &options).raw_coefficients;
        let exact = Reference::fit(&self.x, &self.y, self.order).unwrap().coefficients();
        let digits = |want: &[f64]| {
            assert_eq!(got.len(), want.len(), "{}", self.name);
            got.iter().zip(want).map(|(got, want)| -((got - want) / want).abs().log10()).fold(16.0, f64::min)
        };
        let (exact, certified) = (digits(&exact.iter().map(to_f64).collect::<Vec<_>>()), digits(&self.certified));
        println!("{}: {exact:.1} correct digits, {certified:.1} of the certified ones", self.name);
        assert!(exact >= 15.9 && certified >= 13.0, "{}: {exact:.1}, {certified:.1}", self.name);
    }
}

#[test]
fn every_set_that_needs_no_file_has_all_digits() {
    (1..=5).map(wampler).for_each(|set| set.check());
    Set::parse("filip", 10, FILIP, OF_FILIP.to_vec()).check();
}

#[test]
fn every_set_of_the_collection_at_hand() {
    let fallback = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let dir = std::env::var_os("TAXELD_DATA").map_or_else(fallback, PathBuf::from).join("strd");
    for (name, order) in [("norris", 1), ("pontius", 2), ("wampler1", 5), ("wampler2", 5), ("wampler3", 5)] {
        let (data, certified) = (dir.join(format!("{name}.csv")), dir.join(format!("{name}.certified.csv")));
        let (Ok(data), Ok(certified)) = (std::fs::read_to_string(&data), std::fs::read_to_string(&certified)) else {
            eprintln!("SKIPPED {name}: no file {}", data.display());
            continue;
        };
        let column = |line: &str| line.split(',').nth(3).unwrap().trim().parse().unwrap();
        Set::parse(name, order, &data, certified.lines().skip(1).map(column).collect()).check();
    }
}
