//! Group 1: whether the least-squares solution is the exact one, from easy to nearly singular.

use crate::reference::Reference;
use crate::stability::case::{Case, Outcome, Problem, greatest};
use crate::stability::taxels::{NOMINAL, Recording, random, wide};
use crate::stability::trial::{against_exact, counts_in_range, fit_of, per_sample, sound};
use crate::{Estimator, FitOptions, FixedPressure};
use rand::RngExt;
use std::collections::BTreeMap;

/// The widest order that a daemon may be asked for.
const ORDERS: [u8; 3] = [5, 9, 10];

pub(super) fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = ORDERS
        .into_iter()
        .map(|order| {
            let number = format!("1.1.{order}");
            let name = format!("sound 8-bit taxel, order {order}");
            Case::exact(number, name, move || of_order(&NOMINAL.ramp(3000, 1), order))
        })
        .collect();
    cases.push(Case {
        figure: "max |dP| / max |P| against exact least squares on the same bins",
        ..Case::exact("1.2", "sound 8-bit taxel, pressure-binned, order 5", binned)
    });
    for (bits, gain) in [(16, 19_000.0), (24, 5_000_000.0)] {
        for order in [5, 9] {
            let number = format!("1.3.{bits}.{order}");
            let name = format!("{bits}-bit counts, order {order}");
            cases.push(Case::exact(number, name, move || of_order(&wide(bits, gain).ramp(300, 10), order)));
        }
    }
    for order in [5, 9] {
        let name = format!("counts just below 2^24, order {order}");
        cases.push(Case::exact(format!("1.4.{order}"), name, move || of_order(&below_2_24(), order)));
    }
    cases.extend(offsets());
    cases.extend(weights());
    cases
}

fn offsets() -> [Case; 4] {
    [
        Case {
            expected: "interval_too_wide",
            flags: &["rank_reduced", "few_distinct_counts"],
            also: "rank is 3 exactly",
            ..Case::exact("1.5", "counts 1e6 - 1, 1e6 and 1e6 + 1", million)
        },
        Case::exact("1.6", "counts next to 1e15, the largest that are taken", || {
            of_order(&NOMINAL.ramp(500, 16).with_counts(|c| 1e15 - 255.0 + c), 5)
        }),
        Case::exact("1.7", "real counts: a zero that moved by 0.37, as a second ramp has", || {
            of_order(&NOMINAL.ramp(3000, 17).with_counts(|c| c + 0.37), 5)
        }),
        Case::exact("1.8", "counts in farad, about 1e-12", || {
            of_order(&NOMINAL.ramp(250, 18).with_counts(|c| c * 1e-14), 5)
        }),
    ]
}

fn weights() -> [Case; 6] {
    [
        Case {
            expected: "ok",
            flags: &["few_distinct_counts"],
            also: "the flag counts 7 distinct counts, not 7000 samples",
            ..Case::exact("1.9", "7 points, each 1000 times", || of_order(&seven_points().repeated(1000), 5))
        },
        Case {
            flags: &["few_distinct_counts"],
            ..Case::exact("1.10", "as many points as coefficients, each 1000 times", || {
                let six = Recording::new(seven_points().pairs().take(6));
                of_order(&six.repeated(1000), 5)
            })
        },
        Case {
            flags: &["high_leverage", "gap"],
            limit: 1e-10,
            ..Case::exact("1.11", "5 counts close together and a lone one far away: nearly singular", lone_far)
        },
        Case {
            flags: &["rank_reduced", "high_leverage", "gap"],
            limit: 1e-9,
            also: "the order falls until the curve can be held",
            ..Case::exact(
                "1.12",
                "9 counts of 24 bits close together and a dropout to 0: beyond f64",
                dropout_of_24_bits,
            )
        },
        Case::exact("1.13", "100,000 scans", || of_order(&NOMINAL.ramp(100_000, 112), 5)),
        Case {
            figure: "max |dP| / max |P| between each scan once and twice",
            also: "rank and order stay",
            ..Case::exact("1.14", "duplicated frames: every scan twice", twice)
        },
    ]
}

fn of_order(recording: &Recording, order: u8) -> Outcome {
    let (model, mut outcome) = against_exact(recording, order);
    let distinct = usize::from(model.quality.rank).min(usize::from(order) + 1);
    outcome.require(usize::from(model.order) + 1 == distinct, || format!("order {} came out", model.order));
    outcome
}

fn below_2_24() -> Recording {
    Recording::new((0..400).map(|k| {
        let k = f64::from(k);
        (16_777_216.0 - (k / 2.0).floor(), 0.3 * k + 5.0 * (k / 50.0).sin())
    }))
}

fn million() -> Outcome {
    let mut random = random(8);
    let sample = |k: i32| {
        let step = f64::from(k % 3);
        (1e6 + step - 1.0, 20.0 * step + random.random_range(0.0..30.0))
    };
    let (model, mut outcome) = against_exact(&Recording::new((0..300).map(sample)), 5);
    outcome.require(model.quality.rank == 3, || format!("rank is {}", model.quality.rank));
    outcome
}

fn seven_points() -> Recording {
    let counts = [240.0, 231.0, 222.0, 214.0, 207.0, 201.0, 196.0];
    let kpa = [0.0, 5.1, 11.2, 20.0, 29.5, 41.0, 55.0];
    Recording::new(counts.into_iter().zip(kpa))
}

fn lone_far() -> Outcome {
    let near = (0..200).map(|k| (f64::from(236 + k % 5), 10.0 - 2.0 * f64::from(k % 5) + 0.01 * f64::from(k % 11)));
    against_exact(&Recording::new(near.chain([(20.0, 65.0)])), 5).1
}

fn dropout_of_24_bits() -> Outcome {
    let near = (0..200).map(|k| {
        let step = f64::from(k % 9);
        (15_000_000.0 + step, 10.0 - step + 0.01 * f64::from(k % 11))
    });
    against_exact(&Recording::new(near.chain([(0.0, 65.0)])), 5).1
}

fn twice() -> Outcome {
    let once = NOMINAL.ramp(3000, 113);
    let options = per_sample(5);
    let (one, two) = (fit_of(&once, &options), fit_of(&once.repeated(2), &options));
    let mut outcome = sound(&once.repeated(2), &options, &two);
    outcome
        .require(one.quality.rank == two.quality.rank && one.order == two.order, || "rank or order moved".to_owned());
    let curves = one.curve.zip(two.curve);
    outcome.figure = curves.map_or(f64::NAN, |(one, two)| {
        greatest(once.counts.iter().map(|count| (one.evaluate(*count) - two.evaluate(*count)).abs() / 70.0))
    });
    outcome
}

/// The default estimator: its bins are made once more here, from its definition.
fn binned() -> Outcome {
    // 2^18 units of 2^-10 Pa are a base bin; about 140 rows make two base bins of 275 a row.
    const UNITS_PER_KPA: f64 = 1_024_000.0;
    const UNITS_PER_ROW: i64 = 1 << 19;
    let recording = NOMINAL.ramp(3000, 1);
    let options = FitOptions { estimator: Estimator::PressureBinned, ..per_sample(5) };
    let model = fit_of(&recording, &options);
    let mut outcome = sound(&recording, &options, &model);
    let mut rows: BTreeMap<i64, (f64, f64, f64)> = BTreeMap::new();
    for (count, kpa) in recording.pairs() {
        let units = FixedPressure::from_kpa(kpa).map_or(f64::NAN, |fixed| fixed.to_kpa() * UNITS_PER_KPA);
        let row = rows.entry((units as i64).div_euclid(UNITS_PER_ROW)).or_default();
        // Sums of integers below 2^53: exact.
        *row = (row.0 + 1.0, row.1 + count, row.2 + units);
    }
    let x: Vec<f64> = rows.values().map(|(n, count, _)| count / n).collect();
    let y: Vec<f64> = rows.values().map(|(n, _, units)| units / n / UNITS_PER_KPA).collect();
    let w: Vec<f64> = rows.values().map(|row| row.0).collect();
    let (Some(curve), Some(reference)) = (&model.curve, Reference::fit(&x, &y, Some(&w), 5)) else {
        return Outcome { figure: f64::NAN, ..outcome };
    };
    let counts = counts_in_range(&recording, &model);
    let error = move |evaluate: &dyn Fn(f64) -> f64| {
        greatest(counts.iter().map(|count| (evaluate(*count) - reference.evaluate(*count)).abs() / 70.0))
    };
    let rows = Problem { recording: Recording { counts: x, kpa: y }, weights: Some(w), order: 5 };
    outcome.contest(&|count| curve.evaluate(count), rows, error);
    outcome
}
