//! Group 5: numbers at and beyond the ends of what numbers can be.

use crate::stability::case::{Case, Contest, Outcome, greatest};
use crate::stability::taxels::{NOMINAL, Recording};
use crate::stability::trial::{against_exact, evaluate, fit_of, of_order, sound};
use crate::{FitOptions, Flag, RangeState, Samples, fit};

pub(super) fn cases() -> Vec<Case> {
    let mut cases = vec![
        Case {
            flags: &["rejected"],
            figure: "max |dP| to the fit without them, kPa",
            limit: 0.0,
            also: "all 5 are counted",
            ..Case::exact("5.1", "NaN, infinities and 1e300 among the samples", not_finite)
        },
        Case {
            expected: "no_data",
            flags: &["rejected"],
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("5.2", "nothing but NaN", || {
                nothing(&Recording::new((0..400).map(|_| (f64::NAN, 1.0))), &FitOptions::default())
            })
        },
        Case {
            expected: "no_data",
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("5.3", "no sample at all", || nothing(&Recording::default(), &FitOptions::default()))
        },
        Case {
            expected: "unproven",
            flags: &["rejected"],
            figure: "samples not counted as rejected",
            limit: 0.0,
            ..Case::exact("5.4", "fewer pressures than counts", uneven)
        },
    ];
    cases.extend(pressures());
    cases.push(Case::of(
        "5.9",
        "live counts of NaN, infinities, 1e300 and -1e300",
        "max |P - P at the end of the range|, kPa",
        0.0,
        live_counts,
    ));
    cases
}

fn pressures() -> [Case; 4] {
    [
        Case {
            expected: "no_excitation",
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("5.5", "denormal pressures, about 1e-309 kPa", || {
                nothing(&NOMINAL.ramp(500, 14).with_kpa(|p| p * 1e-310), &of_order(5))
            })
        },
        Case::exact("5.6", "tiny pressures, about 1e-88 kPa", || {
            against_exact(&NOMINAL.ramp(500, 14).with_kpa(|p| p * 1e-90), 5).1
        }),
        Case::exact("5.7", "huge pressures, up to 7e13 kPa", || {
            against_exact(&NOMINAL.ramp(500, 14).with_kpa(|p| p * 1e12), 5).1
        }),
        Case {
            expected: "no_data",
            flags: &["rejected"],
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("5.8", "pressures beyond 1e15 kPa", || {
                nothing(&NOMINAL.ramp(500, 14).with_kpa(|p| 1e16 + p * 1e300), &of_order(5))
            })
        },
    ]
}

fn not_finite() -> Outcome {
    let clean = NOMINAL.ramp(1000, 13);
    let bad = [
        (f64::NAN, 10.0),
        (200.0, f64::INFINITY),
        (201.0, f64::NAN),
        (1e300, 20.0),
        (f64::NEG_INFINITY, f64::NEG_INFINITY),
    ];
    let recording = Recording::new(clean.pairs().chain(bad));
    let options = FitOptions::default();
    let (model, pure) = (fit_of(&recording, &options), fit_of(&clean, &options));
    let mut outcome = sound(&recording, &options, &model);
    let moved = clean.counts.iter().map(|count| (evaluate(&model, *count) - evaluate(&pure, *count)).abs());
    outcome.figure = greatest(moved);
    outcome.contest = Some(Contest::between(&recording, &clean, clean.counts.clone()));
    let counted = model.flags.contains(&Flag::Rejected { samples: 5 });
    outcome.require(counted, || format!("{:?}", model.flags));
    outcome.require(model.sigma == pure.sigma, || "sigma differs".to_owned());
    outcome
}

fn nothing(recording: &Recording, options: &FitOptions) -> Outcome {
    let model = fit_of(recording, options);
    Outcome { figure: f64::from(u8::from(model.curve.is_some())), ..sound(recording, options, &model) }
}

fn uneven() -> Outcome {
    let model = fit(&Samples::new(&[1.0, 2.0, 3.0], &[1.0]), &FitOptions::default());
    let rejected = model.flags.iter().find_map(|flag| match flag {
        Flag::Rejected { samples } => Some(*samples),
        _ => None,
    });
    let flags = crate::stability::trial::flag_words(&model);
    Outcome { figure: 2.0 - rejected.unwrap_or(0) as f64, flags, status: model.status.code(), ..Outcome::default() }
}

fn live_counts() -> Outcome {
    let model = fit_of(&NOMINAL.ramp(3000, 15), &FitOptions::default());
    let [low, high] = model.range.unwrap_or([f64::NAN; 2]);
    let at = |count: f64, end: f64, state: RangeState| -> f64 {
        let reading = model.evaluate(count).filter(|reading| reading.range == state);
        reading.map_or(f64::NAN, |reading| (reading.kpa - evaluate(&model, end)).abs())
    };
    let held = [-1e300, -1.0, low - f64::EPSILON * 256.0].map(|count| at(count, low, RangeState::Below));
    let above = [1e300, 1e9, high + f64::EPSILON * 256.0].map(|count| at(count, high, RangeState::Above));
    let mut outcome = Outcome::of_figure(greatest(held.into_iter().chain(above)));
    for count in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        outcome.require(model.evaluate(count).is_none(), || format!("there is a reading at {count}"));
    }
    outcome
}
