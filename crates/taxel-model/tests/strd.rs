//! NIST's Statistical Reference Datasets that are polynomials: every digit that an f64 can hold.

mod common;

use common::{correct_digits, decimal, exact, int, least_squares, parts};
use num_rational::BigRational;
use std::path::PathBuf;
use taxel_model::{Estimator, FitOptions, Order, Samples, fit};

/// Wampler's disturbance: y = 1 + x + .. + x^5 + factor * DELTA, x = 0..20.
const DELTA: [i64; 21] = [
    759, -2048, 2048, -2048, 2523, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 1838, -2048, 2048, -2048, 2523, -2048,
    2048, -2048, 759,
];

fn options(order: u8, exact: bool) -> FitOptions {
    FitOptions { order: Order::Fixed(order), exact, ..FitOptions::default() }
}

fn with_low_parts<'a>(x: &'a (Vec<f64>, Vec<f64>), y: &'a (Vec<f64>, Vec<f64>)) -> Samples<'a> {
    Samples { counts: &x.0, counts_low: Some(&x.1), pressure_kpa: &y.0, pressure_low: Some(&y.1), ..Samples::default() }
}

/// Digits of the default and of the exact path, from decimals as written and from rounded ones.
fn digits(x: &[&str], y: &[&str], order: u8, want: &[BigRational]) -> [f64; 3] {
    let (x, y) = (parts(x), parts(y));
    let as_written = with_low_parts(&x, &y);
    let score = |samples, exact| correct_digits(&fit(&samples, &options(order, exact)).raw_coefficients, want);
    [score(as_written, false), score(as_written, true), score(Samples::new(&x.0, &y.0), false)]
}

#[test]
fn wampler_1_3_4_5_have_all_digits() {
    for (name, factor) in [("wampler1", 0), ("wampler3", 1), ("wampler4", 100), ("wampler5", 10_000)] {
        let x: Vec<f64> = (0..21).map(f64::from).collect();
        let y: Vec<f64> =
            (0..21_i64).map(|x| ((0..6).map(|k| x.pow(k)).sum::<i64>() + factor * DELTA[x as usize]) as f64).collect();
        for exact in [false, true] {
            let model = fit(&Samples::new(&x, &y), &options(5, exact));
            let digits = correct_digits(&model.raw_coefficients, &vec![int(1); 6]);
            assert!(digits >= 15.9, "{name}, exact {exact}: {digits:.1} {:?}", model.raw_coefficients);
            assert_eq!(model.estimator, Estimator::PerSample);
        }
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
        let rows: Vec<(&str, &str)> = data.lines().skip(1).filter_map(|line| line.split_once(',')).collect();
        let (x, y): (Vec<&str>, Vec<&str>) = rows.into_iter().unzip();
        let column = |line: &str| decimal(line.split(',').nth(3).unwrap());
        let want: Vec<BigRational> = certified.lines().skip(1).map(column).collect();
        let [default, exact, rounded] = digits(&x, &y, order, &want);
        eprintln!("{name}: as written {default:.1}, exact {exact:.1}, decimals rounded to f64 {rounded:.1}");
        assert!(default >= 15.6 && exact >= 15.6, "{name}: {default:.1} {exact:.1}");
        assert!(rounded >= 13.0, "{name}: {rounded:.1}");
    }
}

/// Filip's certified coefficients, of order ten.
const FILIP: [&str; 11] = [
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
fn filip_order_ten_has_all_digits() {
    let rows: Vec<(&str, &str)> =
        include_str!("filip.csv").lines().skip(1).filter_map(|line| line.split_once(',')).collect();
    let (x, y): (Vec<&str>, Vec<&str>) = rows.into_iter().unzip();
    let rational = |text: &[&str]| text.iter().map(|t| decimal(t)).collect::<Vec<_>>();
    let want = least_squares(&rational(&x), &rational(&y), 10);
    for (exact, certified) in want.iter().zip(FILIP) {
        assert!(correct_digits(&[common::to_f64(exact)], &[decimal(certified)]) > 14.0, "the data are Filip's");
    }
    let [default, exact, rounded] = digits(&x, &y, 10, &want);
    eprintln!("filip: as written {default:.1}, exact {exact:.1}, decimals rounded to f64 {rounded:.1}");
    assert!(default >= 15.6 && exact >= 15.6 && rounded >= 13.0, "{default:.1} {exact:.1} {rounded:.1}");
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
    let y: Vec<String> = x
        .iter()
        .map(|x| {
            let x: f64 = x.parse().unwrap();
            format!("{:.4}", 0.845 + 0.07 * ((x + 6.5) * 2.0).tanh() + 0.002 * (next() - 0.5))
        })
        .collect();
    let x: Vec<&str> = x.iter().map(String::as_str).collect();
    let y: Vec<&str> = y.iter().map(String::as_str).collect();
    let rational = |text: &[&str]| text.iter().map(|t| decimal(t)).collect::<Vec<_>>();
    let want = least_squares(&rational(&x), &rational(&y), 10);
    let [default, exact_digits, rounded] = digits(&x, &y, 10, &want);
    eprintln!("order 10: as written {default:.1}, exact {exact_digits:.1}, decimals rounded to f64 {rounded:.1}");
    assert!(default >= 15.6 && exact_digits >= 15.6, "{default:.1} {exact_digits:.1}");
    // Against the exact solution for the rounded decimals nothing is lost either.
    let (hx, hy) = (parts(&x).0, parts(&y).0);
    let floats = |v: &[f64]| v.iter().copied().map(exact).collect::<Vec<_>>();
    let want = least_squares(&floats(&hx), &floats(&hy), 10);
    let model = fit(&Samples::new(&hx, &hy), &options(10, false));
    let digits = correct_digits(&model.raw_coefficients, &want);
    assert!(digits >= 15.6, "{digits:.1}");
}
