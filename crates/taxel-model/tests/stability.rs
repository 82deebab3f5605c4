//! Stiff, extreme and broken taxels: no panic, no NaN, a typed status, and the exact least-squares solution.

#![allow(clippy::unwrap_used)] // Tests; the exemption knows only functions marked as such.

mod common;

use common::{exact, least_squares, to_f64, value};
use num_rational::BigRational;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use taxel_model::{
    Accumulator, Curve, Estimator, FitOptions, FixedPressure, Flag, Order, RangeState, Samples, Shape, Status,
    TaxelModel, fit,
};

/// A standard normal number.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

/// A taxel of the model C = rest - gain P / (P + half) + noise, rounded and clipped to `bits`, on a ramp to 70 kPa.
struct Taxel {
    rest: f64,
    gain: f64,
    half: f64,
    noise: f64,
    bits: u32,
}

impl Taxel {
    fn ramp(&self, samples: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let top = f64::from((1_u32 << self.bits) - 1);
        (0..samples)
            .map(|k| {
                let p = 70.0 * k as f64 / samples as f64 + 0.05 * random.random_range(0.0..1.0);
                let c = self.rest - self.gain * p / (p + self.half) + self.noise * normal(&mut random);
                (c.round().clamp(0.0, top), p)
            })
            .unzip()
    }
}

const NOMINAL: Taxel = Taxel { rest: 240.0, gain: 110.0, half: 40.0, noise: 0.7, bits: 8 };

fn per_sample(order: u8) -> FitOptions {
    FitOptions {
        order: Order::Fixed(order),
        estimator: Estimator::PerSample,
        shape: Shape::Report,
        ..FitOptions::default()
    }
}

/// The exact least-squares polynomial over the samples whose counts satisfy `keep`, by distinct counts.
fn exact_fit(c: &[f64], p: &[f64], order: usize, keep: impl Fn(f64) -> bool) -> Vec<BigRational> {
    let (x, y): (Vec<_>, Vec<_>) = c
        .iter()
        .zip(p)
        .filter(|(c, p)| p.is_finite() && c.is_finite() && keep(**c))
        .map(|(c, p)| (exact(*c), exact(*p)))
        .unzip();
    // About the first count, so that the numbers stay short; `value_at` undoes it.
    let first = x[0].clone();
    let shifted: Vec<BigRational> = x.iter().map(|x| x - &first).collect();
    let mut coefficients = least_squares(&shifted, &y, order);
    coefficients.push(first);
    coefficients
}

/// Largest error of the model at its in-range counts, relative to the largest pressure.
fn relative_error(model: &TaxelModel, want: &[BigRational], c: &[f64], p: &[f64]) -> f64 {
    let (first, coefficients) = want.split_last().unwrap();
    let [low, high] = model.range.unwrap();
    let scale = p.iter().filter(|p| p.is_finite()).fold(0.0, |m: f64, p| m.max(p.abs()));
    let counts: BTreeMap<u64, f64> =
        c.iter().filter(|c| (low..=high).contains(*c)).map(|c| (c.to_bits(), *c)).collect();
    counts
        .values()
        .map(|c| {
            let want = to_f64(&value(coefficients, &(exact(*c) - first)));
            let reading = model.evaluate(*c).unwrap();
            assert!(reading.kpa.is_finite() && !reading.sigma_kpa.is_nan() && reading.sigma_kpa > 0.0);
            (reading.kpa - want).abs() / scale
        })
        .fold(0.0, f64::max)
}

fn check(name: &str, c: &[f64], p: &[f64], order: u8, limit: f64) -> TaxelModel {
    let model = fit(&Samples::new(c, p), &per_sample(order));
    let want = exact_fit(c, p, usize::from(model.order), |_| true);
    let error = relative_error(&model, &want, c, p);
    assert!(error <= limit, "{name}, order {order}: relative error {error:.1e}");
    model
}

fn has(model: &TaxelModel, pattern: fn(&Flag) -> bool) -> bool {
    model.flags.iter().any(pattern)
}

#[test]
fn case_1_nominal() {
    let (c, p) = NOMINAL.ramp(3000, 1);
    for order in [5, 9] {
        let model = check("nominal", &c, &p, order, 1e-13);
        assert_eq!((model.status, model.order), (Status::Ok, order));
    }
}

#[test]
fn case_2_three_codes_carry_order_two() {
    let (c, p) = Taxel { gain: 2.9, noise: 0.0, ..NOMINAL }.ramp(2000, 2);
    let model = check("three codes", &c, &p, 5, 1e-13);
    assert_eq!((model.quality.distinct_counts, model.quality.rank, model.order), (3, 3, 2));
    assert!(has(&model, |f| matches!(f, Flag::RankReduced { asked: 5, used: 2 })));
    assert!(has(&model, |f| matches!(f, Flag::FewDistinctCounts { distinct: 3, .. })));
    assert!(matches!(model.status, Status::IntervalTooWide { .. }), "{}", model.status);
}

#[test]
fn case_3_seven_codes_with_noise_are_excluded_by_their_interval() {
    let (c, p) = Taxel { gain: 4.0, ..NOMINAL }.ramp(2000, 3);
    let model = check("seven codes", &c, &p, 5, 1e-12);
    assert!(matches!(model.status, Status::IntervalTooWide { share, .. } if share > 0.2), "{}", model.status);
    assert!(has(&model, |f| matches!(f, Flag::FewDistinctCounts { .. })));
}

#[test]
fn case_4_a_clipped_taxel_is_fitted_without_its_rail() {
    let taxel = Taxel { rest: 90.0, gain: 230.0, ..NOMINAL };
    let (c, p) = taxel.ramp(6000, 4);
    let clipped = c.iter().filter(|c| **c == 0.0).count() as f64 / c.len() as f64;
    assert!(clipped > 0.5, "{clipped}");
    let truth = |count: f64| taxel.half * (taxel.rest - count) / (taxel.gain - taxel.rest + count);
    for estimator in [Estimator::PerSample, Estimator::PressureBinned] {
        let model = fit(&Samples::new(&c, &p), &FitOptions { estimator, ..FitOptions::default() });
        assert!(has(&model, |f| matches!(f, Flag::RailDropped { count: 0.0, share } if *share > 0.5)));
        // Well clear of the rail the curve is the truth to 1 %; next to it noise itself is clipped.
        for count in [5.0, 10.0, 20.0, 60.0] {
            let got = model.evaluate(count).unwrap().kpa;
            assert!((got / truth(count) - 1.0).abs() < 0.02, "{estimator:?} at {count}: {got} for {}", truth(count));
        }
        assert_eq!(model.evaluate(0.0).unwrap().range, RangeState::Below);
    }
}

#[test]
fn case_5_a_constant_taxel_is_dead() {
    let p: Vec<f64> = (0..100).map(f64::from).collect();
    let model = fit(&Samples::new(&[200.0; 100], &p), &per_sample(5));
    assert_eq!(model.status, Status::Dead { count: 200.0 });
    assert_eq!(model.evaluate(200.0).unwrap().kpa, 49.5);
    assert_eq!(model.evaluate(200.0).unwrap().sigma_kpa, f64::INFINITY);
    assert!(!model.tabulate(0.0).usable);
    let flipping: Vec<f64> = (0..1000).map(|k| f64::from(k % 2 * 255)).collect();
    let rising: Vec<f64> = (0..1000).map(f64::from).collect();
    assert_eq!(fit(&Samples::new(&flipping, &rising), &FitOptions::default()).status, Status::Clipped);
    let railed = fit(&Samples::new(&[0.0; 1000], &vec![1.0; 1000]), &FitOptions::default());
    assert!(matches!(railed.status, Status::NoExcitation { .. }));
}

#[test]
fn case_6_equal_pressures_are_no_calibration() {
    let c: Vec<f64> = (0..500).map(|k| f64::from(200 + k % 7)).collect();
    let model = fit(&Samples::new(&c, &vec![12.5; 500]), &FitOptions::default());
    assert!(matches!(model.status, Status::NoExcitation { .. }));
    assert!(model.curve.is_none() && model.raw_coefficients.is_empty() && model.evaluate(203.0).is_none());
}

#[test]
fn case_7_as_many_coefficients_as_samples_interpolate_and_prove_nothing() {
    for samples in [2_usize, 4, 6] {
        let c: Vec<f64> = (0..samples).map(|k| 240.0 - 7.0 * k as f64 - (k * k) as f64).collect();
        let p: Vec<f64> = (0..samples).map(|k| 1.5 * k as f64 + 0.1).collect();
        let model = check("interpolation", &c, &p, 5, 1e-13);
        assert_eq!(model.status, Status::Unproven { samples: samples as u64 });
        assert_eq!((model.order, model.quality.dof), (samples as u8 - 1, 0.0));
        assert!(model.sigma.is_none() && model.quality.interval_kpa.is_none());
        for (c, p) in c.iter().zip(&p) {
            assert!((model.evaluate(*c).unwrap().kpa - p).abs() < 1e-12);
        }
    }
    let one = fit(&Samples::new(&[200.0], &[5.0]), &per_sample(5));
    assert_eq!((one.status, one.evaluate(200.0).unwrap().kpa), (Status::Unproven { samples: 1 }, 5.0));
    let none = fit(&Samples::default(), &per_sample(5));
    assert_eq!(none.status, Status::NoData);
}

#[test]
fn cases_8_9_10_large_offsets_and_wide_converters() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let (c, p): (Vec<f64>, Vec<f64>) = (0..300)
        .map(|k| (1e6 + f64::from(k % 3) - 1.0, f64::from(k % 3) * 20.0 + random.random_range(0.0..9.0)))
        .unzip();
    assert_eq!(check("offset 1e6", &c, &p, 5, 1e-13).quality.rank, 3);
    for order in [5, 9] {
        let (c, p): (Vec<f64>, Vec<f64>) = (0..400)
            .map(|k| (16_777_216.0 - f64::from(k / 2), 0.3 * f64::from(k) + 5.0 * (f64::from(k) / 50.0).sin()))
            .unzip();
        check("24 bit end", &c, &p, order, 1e-13);
        for (bits, gain) in [(16, 19_000.0), (24, 5_000_000.0)] {
            let rest = f64::from((1_u32 << bits) - 1) * 0.9;
            let (c, p) = Taxel { rest, gain, half: 40.0, noise: gain / 200.0, bits }.ramp(300, 10);
            let model = check("wide converter", &c, &p, order, 1e-13);
            assert_eq!(model.order, order);
        }
    }
}

#[test]
fn case_11_rare_dropouts_to_the_rail_do_not_bend_the_curve() {
    let (mut c, p) = NOMINAL.ramp(3000, 11);
    let clean = fit(&Samples::new(&c, &p), &FitOptions::default());
    for k in (50..3000).step_by(100) {
        c[k] = 0.0;
    }
    for estimator in [Estimator::PerSample, Estimator::PressureBinned] {
        let options = FitOptions { estimator, ..FitOptions::default() };
        let model = fit(&Samples::new(&c, &p), &options);
        let clean = if estimator == Estimator::PerSample {
            fit(&Samples::new(&NOMINAL.ramp(3000, 11).0, &p), &options)
        } else {
            clean.clone()
        };
        for count in 175..238 {
            let moved = model.evaluate(f64::from(count)).unwrap().kpa - clean.evaluate(f64::from(count)).unwrap().kpa;
            assert!(moved.abs() < 0.25, "{estimator:?} at {count}: {moved}");
        }
    }
}

#[test]
fn case_12_an_inverse_law_is_repaired() {
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let (c, p): (Vec<f64>, Vec<f64>) = (0..3000)
        .map(|k| {
            let p = 70.0 * f64::from(k) / 3000.0;
            ((255.0 / (p + 1.0) + 0.5 * normal(&mut random)).round().clamp(0.0, 255.0), p)
        })
        .unzip();
    for order in [5, 9] {
        check("inverse law", &c, &p, order, 1e-12);
        for estimator in [Estimator::PerSample, Estimator::PressureBinned] {
            let options = FitOptions { order: Order::Fixed(order), estimator, ..FitOptions::default() };
            let model = fit(&Samples::new(&c, &p), &options);
            eprintln!(
                "inverse law {order} {estimator:?}: {} {:?} rmse {:.2}",
                model.status, model.flags, model.quality.rmse_kpa
            );
            assert!(model.repaired, "{:?}", model.flags);
            assert_monotone(&model);
            assert!(model.quality.lack_of_fit_f.unwrap() > 3.0);
        }
    }
}

fn assert_monotone(model: &TaxelModel) {
    let [low, high] = model.range.unwrap();
    for shift in [0.0, 0.37] {
        let mut last = f64::NAN;
        for step in 0..=(2.0 * (high - low)) as u32 {
            let kpa = model.evaluate(low + f64::from(step) / 2.0 + shift).unwrap().kpa;
            assert!(last.is_nan() || (kpa - last) * model.sign.as_f64() >= 0.0, "step {step}: {last} to {kpa}");
            last = kpa;
        }
        let table = model.tabulate(shift);
        for pair in table.pressure_kpa.windows(2) {
            assert!((pair[1] - pair[0]) * model.sign.as_f64() as f32 >= 0.0, "{pair:?}");
        }
    }
}

#[test]
fn case_13_what_is_not_finite_is_counted_and_left_out() {
    let (mut c, mut p) = NOMINAL.ramp(1000, 13);
    let clean = fit(&Samples::new(&c, &p), &FitOptions::default());
    c.extend([f64::NAN, 200.0, 201.0, 1e300]);
    p.extend([10.0, f64::INFINITY, f64::NAN, 20.0]);
    let model = fit(&Samples::new(&c, &p), &FitOptions::default());
    assert!(has(&model, |f| matches!(f, Flag::Rejected { samples: 4 })));
    assert_eq!((model.curve, model.sigma), (clean.curve, clean.sigma));
    let none = fit(&Samples::new(&[f64::NAN; 9], &[1.0; 9]), &FitOptions::default());
    assert_eq!(none.status, Status::NoData);
    let uneven = fit(&Samples::new(&[1.0, 2.0, 3.0], &[1.0]), &FitOptions::default());
    assert!(has(&uneven, |f| matches!(f, Flag::Rejected { samples: 2 })));
}

#[test]
fn case_14_denormal_and_huge_pressures() {
    let (c, p) = NOMINAL.ramp(500, 14);
    let tiny: Vec<f64> = p.iter().map(|p| p * 1e-310).collect();
    let model = fit(&Samples::new(&c, &tiny), &per_sample(5));
    assert!(matches!(model.status, Status::NoExcitation { .. }));
    let huge: Vec<f64> = p.iter().map(|p| p * 1e300).collect();
    assert_eq!(fit(&Samples::new(&c, &huge), &per_sample(5)).quality.samples, u64::from(p.contains(&0.0)));
    let large: Vec<f64> = p.iter().map(|p| p * 1e12).collect();
    check("terapascal", &c, &large, 5, 1e-13);
}

#[test]
fn case_15_duplicates_are_weights() {
    let c = [240.0, 231.0, 222.0, 214.0, 207.0, 201.0, 196.0];
    let p = [0.0, 5.1, 11.2, 20.0, 29.5, 41.0, 55.0];
    let many: Vec<f64> = c.iter().copied().cycle().take(7000).collect();
    let pressures: Vec<f64> = p.iter().copied().cycle().take(7000).collect();
    let once = check("seven points", &c, &p, 5, 1e-13);
    let thousand = fit(&Samples::new(&many, &pressures), &per_sample(5));
    for count in 196..=240 {
        let (a, b) = (once.evaluate(f64::from(count)).unwrap().kpa, thousand.evaluate(f64::from(count)).unwrap().kpa);
        assert!((a - b).abs() <= 1e-13 * 55.0, "{count}: {a} {b}");
    }
    assert!(has(&thousand, |f| matches!(f, Flag::FewDistinctCounts { distinct: 7, wanted: 12 })));
}

#[test]
fn case_16_a_lone_far_code_is_flagged() {
    let mut c: Vec<f64> = (0..400).map(|k| f64::from(236 + k % 5)).collect();
    let mut p: Vec<f64> = (0..400).map(|k| 10.0 - 2.0 * f64::from(k % 5) + 0.01 * f64::from(k % 11)).collect();
    c.push(20.0);
    p.push(65.0);
    let model = check("lone far code", &c, &p, 5, 1e-10);
    assert!(has(&model, |f| matches!(f, Flag::HighLeverage { count: 20.0, .. })), "{:?}", model.flags);
}

#[test]
fn case_17_noise_alone_is_excluded() {
    let (c, p) = Taxel { gain: 0.0, noise: 3.0, ..NOMINAL }.ramp(3000, 17);
    check("noise", &c, &p, 5, 1e-12);
    for order in [Order::Fixed(5), Order::Auto] {
        let model = fit(&Samples::new(&c, &p), &FitOptions { order, ..FitOptions::default() });
        assert!(!model.is_usable(), "{order:?}: {}", model.status);
    }
    let auto = fit(&Samples::new(&c, &p), &FitOptions { order: Order::Auto, ..per_sample(5) });
    assert!(auto.order <= 2, "order {}", auto.order);
}

#[test]
fn case_18_a_gap_between_two_clusters_is_flagged_and_wide() {
    let mut random = ChaCha8Rng::seed_from_u64(18);
    let (c, p): (Vec<f64>, Vec<f64>) = (0..600)
        .map(|k| {
            let p = if k % 2 == 0 { random.random_range(0.0..8.0) } else { random.random_range(55.0..70.0) };
            ((240.0 - 110.0 * p / (p + 40.0) + 0.7 * normal(&mut random)).round(), p)
        })
        .unzip();
    let model = check("clusters", &c, &p, 5, 1e-12);
    assert!(has(&model, |f| matches!(f, Flag::Gap { .. })), "{:?}", model.flags);
    let sigma = |count| model.evaluate(count).unwrap().sigma_kpa;
    assert!(sigma(200.0) > 3.0 * sigma(232.0), "{} {}", sigma(200.0), sigma(232.0));
}

#[test]
fn case_19_rising_skin_dips_and_order_of_samples() {
    let (c, mut p) = NOMINAL.ramp(3000, 19);
    let rising: Vec<f64> = c.iter().map(|c| 255.0 - c).collect();
    for k in (100..2900).step_by(50) {
        p.swap(k, k + 20); // the pressure dips and recovers
    }
    let model = fit(&Samples::new(&rising, &p), &FitOptions::default());
    assert_eq!((model.status, model.sign.as_f64()), (Status::Ok, 1.0));
    assert_monotone(&model);
    for estimator in [Estimator::PerSample, Estimator::PressureBinned] {
        for exact in [false, true] {
            let options = FitOptions { estimator, exact, ..FitOptions::default() };
            let forward = fit(&Samples::new(&c, &p), &options);
            let (mut rc, mut rp) = (c.clone(), p.clone());
            rc.reverse();
            rp.reverse();
            rc.rotate_left(777);
            rp.rotate_left(777);
            assert_eq!(fit(&Samples::new(&rc, &rp), &options), forward, "{estimator:?}");
        }
    }
    // Shards of the live accumulator, merged in another order, and the same samples from a file.
    let add = |range: std::ops::Range<usize>| {
        let mut sums = Accumulator::new();
        range.for_each(|k| sums.add(c[k] as u8, FixedPressure::from_kpa(p[k]), 0));
        sums
    };
    let (whole, mut late, early) = (add(0..3000), add(1234..3000), add(0..1234));
    late.merge(&early);
    assert_eq!(whole.fit(&FitOptions::default()), late.fit(&FitOptions::default()));
    assert_eq!(whole.fit(&FitOptions::default()), fit(&Samples::new(&c, &p), &FitOptions::default()));
}

#[test]
fn bins_that_all_share_one_mean_count_are_a_constant() {
    // Each bin holds both counts equally often: the counts say nothing about the pressure.
    let c: Vec<f64> = (0..2000).map(|k| f64::from(200 + k % 2)).collect();
    let p: Vec<f64> = (0..2000).map(|k| f64::from(k / 2) * 0.07).collect();
    for order in [Order::Fixed(5), Order::Auto] {
        let model = fit(&Samples::new(&c, &p), &FitOptions { order, ..FitOptions::default() });
        assert!(matches!(model.status, Status::IntervalTooWide { .. }), "{}", model.status);
        assert!((model.evaluate(200.0).unwrap().kpa - 35.0).abs() < 1.0);
    }
}

#[test]
fn a_model_from_outside_is_checked() {
    let (c, p) = NOMINAL.ramp(2000, 21);
    let good = fit(&Samples::new(&c, &p), &FitOptions::default());
    assert_eq!(good.validate(), Ok(()));
    let curve = good.curve.clone().unwrap();
    let with = |change: &dyn Fn(&mut TaxelModel)| {
        let mut model = good.clone();
        change(&mut model);
        model.validate().unwrap_err().to_string()
    };
    assert!(with(&|m| m.curve = None).contains("no curve"));
    assert!(with(&|m| m.range = Some([2.0, 1.0])).contains("range[1] is 1"));
    assert!(with(&|m| m.curve = Some(Curve { half_width: 0.0, ..curve.clone() })).contains("half_width is 0"));
    assert!(with(&|m| m.curve = Some(Curve { chebyshev: vec![1.0; 12], ..curve.clone() })).contains("12 coefficients"));
    assert!(with(&|m| m.curve = Some(Curve { chebyshev: vec![f64::NAN], ..curve.clone() })).contains("NaN"));
    assert!(with(&|m| m.curve = Some(Curve { chebyshev: vec![0.0, 0.0, 1.0], ..curve.clone() })).contains("monotone"));
}

#[test]
fn extreme_sums_do_not_overflow() {
    let mut sums = Accumulator::new();
    let (low, high) = (FixedPressure::from_kpa(-1000.0), FixedPressure::from_kpa(1000.0));
    for k in 0..1_000_000_u32 {
        sums.add(if k % 2 == 0 { 254 } else { 1 }, if k % 2 == 0 { high } else { low }, 0);
    }
    sums.add(7, FixedPressure::from_kpa(f64::NAN), 0);
    let model = sums.fit(&FitOptions::default());
    assert_eq!((model.quality.samples, model.order), (1_000_000, 1));
    assert!((model.evaluate(254.0).unwrap().kpa - 1000.0).abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Against exact rational arithmetic over converters, swings, orders and noise.
    #[test]
    fn any_taxel_has_the_exact_solution(
        bits in 8_u32..25, swing in 0.01..0.8_f64, half in 5.0..80.0_f64, noise in 0.0..0.05_f64,
        samples in 8_usize..200, order in 1_u8..11, seed: u64,
    ) {
        let top = f64::from((1_u32 << bits) - 1);
        let gain = swing * top * (70.0 + half) / 70.0;
        let taxel = Taxel { rest: 0.9 * top, gain, half, noise: noise * swing * top, bits };
        let (c, p) = taxel.ramp(samples, seed);
        let distinct: std::collections::BTreeSet<u64> = c.iter().map(|c| c.to_bits()).collect();
        prop_assume!(distinct.len() > 1);
        let model = check("any", &c, &p, order, 1e-12);
        prop_assert_eq!(usize::from(model.order), usize::from(order).min(distinct.len() - 1));
    }
}
