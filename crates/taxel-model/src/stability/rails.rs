//! Group 4: readings that are no measurement: clipped, dropped out, or stuck.

use crate::stability::case::{Case, Contest, Outcome, Problem, greatest};
use crate::stability::taxels::{NOMINAL, Recording, Taxel};
use crate::stability::trial::{evaluate, fit_of, sound};
use crate::{Estimator, FitOptions, RangeState, Status};

const ESTIMATORS: [(Estimator, &str); 2] =
    [(Estimator::PerSample, "per sample"), (Estimator::PressureBinned, "pressure-binned")];

const TO_TRUTH: &str = "max |P / true P - 1| off the rail";
const TO_CLEAN: &str = "max |dP| to the fit without the dropouts, kPa";
const TO_MEAN: &str = "|P - mean P|, kPa";

/// More than half of the ramp lies on count 0.
const CLIPPED_LOW: Taxel = Taxel { rest: 90.0, gain: 230.0, ..NOMINAL };

/// At 255 up to 4 kPa, at 0 from 67 kPa on.
const CLIPPED_BOTH: Taxel = Taxel { rest: 300.0, gain: 480.0, ..NOMINAL };

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (k, (estimator, words)) in (1..).zip(ESTIMATORS) {
        cases.push(Case {
            flags: &["rail_dropped"],
            figure: TO_TRUTH,
            limit: 0.01,
            also: "a reading on the rail is told to be out of range",
            ..Case::exact(format!("4.1.{k}"), format!("62 % of the ramp clipped at 0, {words}"), move || {
                clipped(CLIPPED_LOW, estimator, &[5.0, 10.0, 20.0, 60.0])
            })
        });
    }
    for (k, (estimator, words)) in (1..).zip(ESTIMATORS) {
        cases.push(Case {
            flags: &["rail_dropped"],
            figure: TO_TRUTH,
            limit: 0.01,
            also: "a reading on either rail is told to be out of range",
            ..Case::exact(format!("4.2.{k}"), format!("clipped at both rails, {words}"), move || {
                clipped(CLIPPED_BOTH, estimator, &[10.0, 20.0, 60.0, 120.0, 200.0, 240.0])
            })
        });
    }
    for (k, (estimator, words)) in (1..).zip(ESTIMATORS) {
        for rail in [0, 255] {
            let name = format!("1 % of the readings drop out to {rail}, {words}");
            cases.push(Case {
                flags: &["rail_dropped"],
                figure: TO_CLEAN,
                limit: 0.1,
                ..Case::exact(format!("4.3.{k}.{rail}"), name, move || dropouts(estimator, f64::from(rail)))
            });
        }
    }
    cases.push(Case {
        figure: "max |dP| to the fit without the dropouts, over the model's own sigma",
        limit: 1.0,
        ..Case::exact("4.4", "1 % of the readings drop out to 12, which is no rail", within_sigma)
    });
    cases.extend(stuck());
    cases
}

fn stuck() -> [Case; 4] {
    let rising = |k: u32| f64::from(k);
    [
        Case {
            expected: "dead",
            figure: TO_MEAN,
            limit: 0.0,
            also: "the interval is infinite",
            ..Case::exact("4.5", "constant taxel", move || stuck_at(|_| 200.0, rising, 49.5))
        },
        Case {
            expected: "dead",
            figure: TO_MEAN,
            limit: 0.0,
            ..Case::exact("4.6", "constant taxel on a rail", move || stuck_at(|_| 0.0, rising, 49.5))
        },
        Case {
            expected: "clipped",
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("4.7", "flips between both rails", move || {
                let recording = Recording::new((0..1000).map(|k| (f64::from(k % 2 * 255), f64::from(k))));
                let model = fit_of(&recording, &FitOptions::default());
                let figure = f64::from(u8::from(model.curve.is_some()));
                Outcome { figure, ..sound(&recording, &FitOptions::default(), &model) }
            })
        },
        Case {
            expected: "no_excitation",
            figure: "curves given",
            limit: 0.0,
            ..Case::exact("4.8", "on a rail, and no excitation either", move || {
                let recording = Recording::new((0..1000).map(|_| (0.0, 1.0)));
                let model = fit_of(&recording, &FitOptions::default());
                let figure = f64::from(u8::from(model.curve.is_some()));
                Outcome { figure, ..sound(&recording, &FitOptions::default(), &model) }
            })
        },
    ]
}

fn clipped(taxel: Taxel, estimator: Estimator, counts: &[f64]) -> Outcome {
    let recording = taxel.ramp(6000, 4);
    let options = FitOptions { estimator, ..FitOptions::default() };
    let model = fit_of(&recording, &options);
    let mut outcome = sound(&recording, &options, &model);
    let counts = counts.to_vec();
    let error = move |evaluate: &dyn Fn(f64) -> f64| {
        greatest(counts.iter().map(|count| (evaluate(*count) / taxel.true_kpa(*count) - 1.0).abs()))
    };
    let problem = Problem { recording: recording.clone(), weights: None, order: 5 };
    outcome.contest(&|count| evaluate(&model, count), problem, error);
    let rails = [(0.0, RangeState::Below), (255.0, RangeState::Above)];
    for (rail, state) in rails.into_iter().filter(|(rail, _)| recording.counts.contains(rail)) {
        let told = model.evaluate(rail).map(|reading| reading.range);
        outcome.require(told == Some(state), || format!("the reading at {rail} is told as {told:?}"));
    }
    outcome
}

/// The sound taxel's ramp without and with every hundredth reading lost.
fn losing(to: f64) -> (Recording, Recording) {
    let clean = NOMINAL.ramp(3000, 11);
    let mut dropped = clean.clone();
    dropped.counts.iter_mut().skip(50).step_by(100).for_each(|count| *count = to);
    (clean, dropped)
}

/// Nothing marks such a reading as none: it enters the mean of its bin. What is asked is that the error be told.
fn within_sigma() -> Outcome {
    let (clean, dropped) = losing(12.0);
    let options = FitOptions::default();
    let (with, without) = (fit_of(&dropped, &options), fit_of(&clean, &options));
    let error = |count: f64| {
        let sigma = with.evaluate(count).map_or(f64::NAN, |reading| reading.sigma_kpa);
        (evaluate(&with, count) - evaluate(&without, count)).abs() / sigma
    };
    Outcome { figure: greatest((175..238).map(f64::from).map(error)), ..sound(&dropped, &options, &with) }
}

fn dropouts(estimator: Estimator, rail: f64) -> Outcome {
    let (clean, dropped) = losing(rail);
    let options = FitOptions { estimator, ..FitOptions::default() };
    let (with, without) = (fit_of(&dropped, &options), fit_of(&clean, &options));
    let mut outcome = sound(&dropped, &options, &with);
    let counts: Vec<f64> = (175..238).map(f64::from).collect();
    outcome.figure = greatest(counts.iter().map(|count| (evaluate(&with, *count) - evaluate(&without, *count)).abs()));
    outcome.contest = Some(Contest::between(&dropped, &clean, counts));
    outcome
}

fn stuck_at(count: impl Fn(u32) -> f64, kpa: impl Fn(u32) -> f64, mean: f64) -> Outcome {
    let recording = Recording::new((0..100).map(|k| (count(k), kpa(k))));
    let options = FitOptions::default();
    let model = fit_of(&recording, &options);
    let mut outcome = sound(&recording, &options, &model);
    let at = recording.counts[0];
    outcome.require(model.status == Status::Dead { count: at }, || format!("{:?}", model.status));
    outcome.figure = (evaluate(&model, at) - mean).abs();
    let sigma = model.evaluate(at).map(|reading| reading.sigma_kpa);
    outcome.require(sigma == Some(f64::INFINITY), || format!("sigma is {sigma:?}"));
    outcome.require(!model.tabulate(0.0).usable, || "the table is usable".to_owned());
    outcome
}
