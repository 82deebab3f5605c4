//! NIST's Statistical Reference Datasets that are polynomials: every digit that an f64 can hold.
#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

use num_rational::BigRational;
use std::path::PathBuf;
use taxel_model::stability::reference::{correct_digits, decimal, exact, least_squares};
use taxel_model::stability::strd::{Set, built_in};
use taxel_model::{FitOptions, Samples, TaxelModel, fit};

fn model(samples: &Samples<'_>, order: usize) -> TaxelModel {
    fit(samples, &FitOptions { order: order as u8, ..FitOptions::default() })
}

/// Digits from decimals as written, and from rounded ones.
fn digits(set: &Set, want: &[BigRational]) -> [f64; 2] {
    let (x, y) = set.parts();
    let as_written = Samples { counts_low: Some(&x.1), pressure_low: Some(&y.1), ..Samples::new(&x.0, &y.0) };
    let score = |samples| correct_digits(&model(samples, set.order).raw_coefficients, want).unwrap();
    [score(&as_written), score(&Samples::new(&x.0, &y.0))]
}

#[test]
fn every_set_that_needs_no_file_has_all_digits() {
    for set in built_in() {
        let [written, rounded] = digits(&set, &set.exact);
        eprintln!("{}: as written {written:.1}, decimals rounded to f64 {rounded:.1}", set.name);
        // The integers of all but the second and the last.
        let integers = !["wampler2", "filip"].contains(&set.name.as_str());
        let least = if integers { 15.9 } else { 15.6 };
        assert!(written >= least, "{}: {written:.1}", set.name);
        assert!(rounded >= if integers { 15.9 } else { 13.0 }, "{}: {rounded:.1}", set.name);
    }
}

fn data_dir() -> PathBuf {
    let fallback = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("TAXELD_DATA").map_or_else(fallback, PathBuf::from).join("strd")
}

#[test]
fn every_set_of_the_collection_at_hand() {
    let dir = data_dir();
    for (name, order) in [("norris", 1), ("pontius", 2), ("wampler1", 5), ("wampler2", 5), ("wampler3", 5)] {
        let (data, certified) = (dir.join(format!("{name}.csv")), dir.join(format!("{name}.certified.csv")));
        let (Ok(data), Ok(certified)) = (std::fs::read_to_string(&data), std::fs::read_to_string(&certified)) else {
            eprintln!("SKIPPED {name}: no file {}", data.display());
            continue;
        };
        let set = Set::parse(name, order, &data).unwrap();
        let column = |line: &str| decimal(line.split(',').nth(3).unwrap()).unwrap();
        let want: Vec<BigRational> = certified.lines().skip(1).map(column).collect();
        let [written, rounded] = digits(&set, &want);
        eprintln!("{name}: as written {written:.1}, decimals rounded to f64 {rounded:.1}");
        assert!(written >= 15.6, "{name}: {written:.1}");
        assert!(rounded >= 13.0, "{name}: {rounded:.1}");
        if let Some(same) = built_in().iter().find(|set| set.name == name) {
            assert_eq!(same.exact, set.exact, "{name} differs from its definition");
        }
    }
}

#[test]
fn an_ill_conditioned_set_of_order_ten() {
    // Like Filip: 82 decimals between -9 and -3, a raw Vandermonde matrix of condition 1e15.
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let x: Vec<String> = (0..82).map(|_| format!("-{:.9}", 3.13 + 5.65 * next())).collect();
    let row = |x: &String| {
        let at: f64 = x.parse().unwrap();
        format!("\n{x},{:.4}", 0.845 + 0.07 * ((at + 6.5) * 2.0).tanh() + 0.002 * (next() - 0.5))
    };
    let set = Set::parse("ill", 10, &("x,y".to_owned() + &x.iter().map(row).collect::<String>())).unwrap();
    let [written, rounded] = digits(&set, &set.exact);
    eprintln!("order 10: as written {written:.1}, decimals rounded to f64 {rounded:.1}");
    assert!(written >= 15.6, "{written:.1}");
    // Against the exact solution for the rounded decimals nothing is lost either.
    let ((x, _), (y, _)) = set.parts();
    let floats = |v: &[f64]| v.iter().map(|v| exact(*v).unwrap()).collect::<Vec<_>>();
    let want = least_squares(&floats(&x), &floats(&y), 10).unwrap();
    let digits = correct_digits(&model(&Samples::new(&x, &y), 10).raw_coefficients, &want).unwrap();
    assert!(digits >= 15.6, "{digits:.1}");
}
