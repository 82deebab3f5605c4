//! Group 9: long runs. Sums are integers: exact, without overflow, and the same in whatever order they are made.

use crate::reference::{Reference, exact, integer, to_f64};
use crate::stability::case::{Case, Outcome, Problem, greatest};
use crate::stability::taxels::{NOMINAL, Recording, random, wide};
use crate::stability::trial::{fit_of, per_sample};
use crate::{Accumulator, Estimator, FitOptions, FixedPressure, Shape, TaxelModel};
use num_bigint::BigInt;
use num_rational::BigRational;
use rand::RngExt;

/// A hundred days at 100 scans a second, and some.
const LONG: u64 = 1_000_000_000;

/// The most samples that an accumulator may hold.
const MOST: u64 = u32::MAX as u64;

/// The greatest pressure that it takes, kPa.
const GREATEST_KPA: f64 = 1000.0;

const SAME_BITS: &str = "models that differ in any bit";

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case {
            figure: "max |dP| / max |P| against exact least squares on 1e9 scans",
            also: "number, pure error and range are those of exact integers, to 1e-14",
            ..Case::exact("9.1", "1e9 scans of a sound taxel", || long(&ordinary(), LONG))
        },
        Case {
            expected: "interval_too_wide",
            figure: "max |dP| / max |P| against exact least squares on 2^32 - 1 scans",
            also: "number, pure error and range are those of exact integers, to 1e-14",
            ..Case::exact("9.2", "2^32 - 1 scans, the most there may be, at pressures of +-1000 kPa", || {
                long(&extreme(), MOST)
            })
        },
        Case::of("9.3", "headroom of a sum of P at 1e9 scans of 1000 kPa", "sum / 2^63", 0.125, headroom),
        Case::of("9.4", "another order of the samples: 20 shuffles", SAME_BITS, 0.0, || {
            shuffles(&NOMINAL.ramp(3000, 94))
        }),
        Case::of("9.5", "1 to 64 shards, merged in any order", SAME_BITS, 0.0, shards),
        Case::of("9.6", "replay: the same scans twice, live and from slices", SAME_BITS, 0.0, replay),
        Case::of("9.7", "counts of 16 bit in another order: 20 shuffles", SAME_BITS, 0.0, || {
            shuffles(&wide(16, 19_000.0).ramp(1000, 97))
        }),
        Case::of("9.8", "scans without a pressure among 1e6", "rejections not counted", 0.0, rejections),
    ]
}

/// All ways of fitting that a daemon may be asked for.
fn ways() -> Vec<FitOptions> {
    let estimators = [Estimator::PerSample, Estimator::PressureBinned];
    let way = |estimator| [false, true].map(|exact| FitOptions { estimator, exact, ..FitOptions::default() });
    estimators.into_iter().flat_map(way).collect()
}

fn accumulate(recording: &Recording) -> Accumulator {
    let mut sums = Accumulator::new();
    sums.extend(recording.pairs().map(|(count, kpa)| (count as u8, FixedPressure::from_kpa(kpa))), 0);
    sums
}

/// Pressures as the accumulator has them, so that nothing is lost before the comparison.
fn fixed(recording: &Recording) -> Recording {
    recording.with_kpa(|kpa| FixedPressure::from_kpa(kpa).map_or(f64::NAN, FixedPressure::to_kpa))
}

fn ordinary() -> Recording {
    fixed(&NOMINAL.ramp(1000, 91))
}

/// All counts but the rails, at pressures that rise to the greatest and, at every other sample, are its negative.
fn extreme() -> Recording {
    let level = |count: u32| GREATEST_KPA * f64::from(count) / 254.0;
    fixed(&Recording::new(
        (1..=254).flat_map(|c| [(f64::from(c), level(c)), (f64::from(c), -GREATEST_KPA / f64::from(c))]),
    ))
}

/// A recording as often as it takes, and its beginning once more, to make `scans` scans: by doubling.
fn repeat(recording: &Recording, scans: u64) -> (Accumulator, Vec<f64>) {
    let (rounds, rest) = (scans / recording.counts.len() as u64, (scans % recording.counts.len() as u64) as usize);
    let mut sums = accumulate(&Recording::new(recording.pairs().take(rest)));
    let mut power = accumulate(recording);
    for bit in 0..64 - rounds.leading_zeros() {
        if rounds >> bit & 1 == 1 {
            sums.merge(&power);
        }
        if rounds >> bit > 1 {
            let same = power.clone();
            power.merge(&same);
        }
    }
    let weight = |k: usize| (rounds + u64::from(k < rest)) as f64;
    (sums, (0..recording.counts.len()).map(weight).collect())
}

fn long(recording: &Recording, scans: u64) -> Outcome {
    let (sums, weights) = repeat(recording, scans);
    let model = sums.fit(&per_sample(5));
    let mut outcome = Outcome { status: model.status.code(), figure: f64::NAN, ..Outcome::default() };
    outcome.require(sums.samples() == scans, || format!("{} samples", sums.samples()));
    outcome.require(model.quality.samples == scans, || format!("{} samples fitted", model.quality.samples));
    let ends = recording.counts.iter().fold((f64::NAN, f64::NAN), |(lo, hi), c| (lo.min(*c), hi.max(*c)));
    let range = sums.count_range().map(|(low, high)| (f64::from(low), f64::from(high)));
    outcome.require(range == Some(ends), || format!("counts from {range:?}, expected {ends:?}"));
    let (pure, wanted) = (model.quality.pure_error_kpa.unwrap_or(f64::NAN), pure_error(recording, &weights));
    outcome.require((pure / wanted - 1.0).abs() <= 1e-14, || format!("pure error {pure} kPa, expected {wanted} kPa"));
    let Some(reference) = Reference::fit(&recording.counts, &recording.kpa, Some(&weights), 5) else { return outcome };
    let scale = greatest(recording.kpa.iter().map(|kpa| kpa.abs()));
    let counts = recording.counts.clone();
    let error = move |evaluate: &dyn Fn(f64) -> f64| {
        greatest(counts.iter().map(|c| (evaluate(*c) - reference.evaluate(*c)).abs() / scale))
    };
    let ours = |count: f64| model.curve.as_ref().map_or(f64::NAN, |curve| curve.evaluate(count));
    outcome.contest(&ours, Problem { recording: recording.clone(), weights: Some(weights), order: 5 }, error);
    outcome
}

/// Root of the mean square of the pressures about their mean at each count, kPa; in exact rationals up to the root.
fn pure_error(recording: &Recording, weights: &[f64]) -> f64 {
    let number = |value: f64| exact(value).unwrap_or_else(|| integer(0));
    let (mut squares, mut samples, mut codes) = (integer(0), integer(0), integer(0));
    for code in 0..=255 {
        let (mut n, mut p, mut p2) = (integer(0), integer(0), integer(0));
        for ((_, kpa), w) in recording.pairs().zip(weights).filter(|((count, _), _)| *count == f64::from(code)) {
            let (w, kpa) = (number(*w), number(kpa));
            p += &w * &kpa;
            p2 += &w * &kpa * &kpa;
            n += w;
        }
        if n != integer(0) {
            squares += p2 - &p * &p / &n;
            samples += n;
            codes += integer(1);
        }
    }
    to_f64(&(squares / (samples - codes))).sqrt()
}

fn headroom() -> Outcome {
    // 2^-10 Pa is the unit of the sums, which are signed integers of 64 bits.
    let units = BigInt::from(1_024_000_000_i64) * BigInt::from(LONG);
    let share = BigRational::new(units, BigInt::from(1) << 63);
    let mut outcome = Outcome::of_figure(to_f64(&share));
    // And the accumulator itself at this sum, on one count beside which another has its negative.
    let ends = Recording::new([(1.0, GREATEST_KPA), (254.0, -GREATEST_KPA)]);
    let (sums, _) = repeat(&ends, 2 * LONG);
    let model = sums.fit(&FitOptions { shape: Shape::Report, ..per_sample(1) });
    for (count, kpa) in ends.pairs() {
        let got = model.evaluate(count).map(|reading| reading.kpa);
        outcome.require(got.is_some_and(|got| (got - kpa).abs() < 1e-9), || format!("{got:?} at {count}"));
    }
    outcome
}

/// How many of the other models differ from the first of their way of fitting.
fn differing<T>(
    first: impl Fn(&FitOptions) -> TaxelModel,
    others: &[T],
    fit_other: impl Fn(&T, &FitOptions) -> TaxelModel,
) -> Outcome {
    let differs = |options: &FitOptions| {
        let model = first(options);
        others.iter().filter(|other| fit_other(other, options) != model).count()
    };
    Outcome::of_figure(ways().iter().map(differs).sum::<usize>() as f64)
}

fn shuffled(recording: &Recording, seed: u64) -> Recording {
    let (mut random, mut pairs) = (random(seed), recording.pairs().collect::<Vec<_>>());
    for k in (1..pairs.len()).rev() {
        pairs.swap(k, random.random_range(0..=k));
    }
    Recording::new(pairs)
}

fn shuffles(whole: &Recording) -> Outcome {
    let others: Vec<Recording> = (0..20).map(|seed| shuffled(whole, seed)).collect();
    differing(|options| fit_of(whole, options), &others, fit_of)
}

fn shards() -> Outcome {
    let whole = NOMINAL.ramp(3000, 95);
    let merged: Vec<Accumulator> = [1, 2, 3, 7, 64].map(|shards| merged(&whole, shards)).into();
    let sums = accumulate(&whole);
    let mut outcome = differing(|options| sums.fit(options), &merged, Accumulator::fit);
    outcome.require(merged.iter().all(|other| *other == sums), || "the sums themselves differ".to_owned());
    outcome
}

/// The sums of a recording dealt out to shards at random, merged the last one first.
fn merged(whole: &Recording, shards: usize) -> Accumulator {
    let mut random = random(shards as u64);
    let mut parts = vec![Recording::default(); shards];
    for (count, kpa) in whole.pairs() {
        let part = &mut parts[random.random_range(0..shards)];
        part.counts.push(count);
        part.kpa.push(kpa);
    }
    let mut sums = Accumulator::new();
    parts.iter().rev().for_each(|part| sums.merge(&accumulate(part)));
    sums
}

fn replay() -> Outcome {
    let whole = NOMINAL.ramp(3000, 96);
    let mut outcome = differing(|options| fit_of(&whole, options), &[&whole, &whole], |again, way| fit_of(again, way));
    // A table of the same scans takes the live path too, with the default estimator.
    let options = FitOptions::default();
    let live = accumulate(&whole).fit(&options) == fit_of(&whole, &options);
    outcome.require(live, || "scans from a table give other bits than live ones".to_owned());
    outcome
}

fn rejections() -> Outcome {
    let mut sums = Accumulator::new();
    let sample = |k: u32| {
        (100 + (k % 100) as u8, if k.is_multiple_of(1000) { None } else { FixedPressure::from_kpa(f64::from(k % 70)) })
    };
    sums.extend((0..1_000_000).map(sample), 0);
    let model = sums.fit(&FitOptions::default());
    let rejected = model.flags.iter().find_map(|flag| match flag {
        crate::Flag::Rejected { samples } => Some(*samples),
        _ => None,
    });
    let mut outcome = Outcome::of_figure(1000.0 - rejected.unwrap_or(0) as f64);
    outcome.require(sums.samples() == 999_000, || format!("{} samples", sums.samples()));
    outcome
}
