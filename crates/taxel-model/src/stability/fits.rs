//! Group 1: whether the least-squares solution is the exact one, from easy to nearly singular.

use crate::stability::case::{Case, Outcome, greatest};
use crate::stability::taxels::{NOMINAL, Recording, random, wide};
use crate::stability::trial::{against_exact, fit_of, of_order, sound};
use rand::RngExt;

/// The widest order that a daemon may be asked for.
const ORDERS: [u8; 3] = [5, 9, 10];

pub(super) fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = ORDERS
        .into_iter()
        .map(|order| {
            let number = format!("1.1.{order}");
            let name = format!("sound 8-bit taxel, order {order}");
            Case::exact(number, name, move || carried(&NOMINAL.ramp(3000, 1), order))
        })
        .collect();
    for (bits, gain) in [(16, 19_000.0), (24, 5_000_000.0)] {
        for order in [5, 9] {
            let number = format!("1.3.{bits}.{order}");
            let name = format!("{bits}-bit counts, order {order}");
            cases.push(Case::exact(number, name, move || carried(&wide(bits, gain).ramp(300, 10), order)));
        }
    }
    for order in [5, 9] {
        let name = format!("counts just below 2^24, order {order}");
        cases.push(Case::exact(format!("1.4.{order}"), name, move || carried(&below_2_24(), order)));
    }
    cases.extend(offsets());
    cases.extend(weights());
    cases
}

fn offsets() -> [Case; 4] {
    [
        Case {
            flags: &["rank_reduced", "few_distinct_counts"],
            also: "rank is 3 exactly",
            ..Case::exact("1.5", "counts 1e6 - 1, 1e6 and 1e6 + 1", million)
        },
        Case::exact("1.6", "counts next to 1e15, the largest that are taken", || {
            carried(&NOMINAL.ramp(500, 16).with_counts(|c| 1e15 - 255.0 + c), 5)
        }),
        Case::exact("1.7", "real counts: a zero that moved by 0.37, as a second ramp has", || {
            carried(&NOMINAL.ramp(3000, 17).with_counts(|c| c + 0.37), 5)
        }),
        Case::exact("1.8", "counts in farad, about 1e-12", || {
            carried(&NOMINAL.ramp(250, 18).with_counts(|c| c * 1e-14), 5)
        }),
    ]
}

fn weights() -> [Case; 6] {
    [
        Case {
            flags: &["few_distinct_counts"],
            also: "the flag counts 7 distinct counts, not 7000 samples",
            ..Case::exact("1.9", "7 points, each 1000 times", || carried(&seven_points().repeated(1000), 5))
        },
        Case {
            flags: &["few_distinct_counts"],
            ..Case::exact("1.10", "as many points as coefficients, each 1000 times", || {
                let six = Recording::new(seven_points().pairs().take(6));
                carried(&six.repeated(1000), 5)
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
        Case::exact("1.13", "100,000 scans", || carried(&NOMINAL.ramp(100_000, 112), 5)),
        Case {
            figure: "max |dP| / max |P| between each scan once and twice",
            also: "rank and order stay",
            ..Case::exact("1.14", "duplicated frames: every scan twice", twice)
        },
    ]
}

fn carried(recording: &Recording, order: u8) -> Outcome {
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
    let options = of_order(5);
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
