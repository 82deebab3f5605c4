//! Group 3: curves that must be monotone, whichever way the skin answers.

use crate::stability::case::{Case, Outcome};
use crate::stability::taxels::{NOMINAL, Recording, normal, random};
use crate::stability::trial::{against_exact, evaluate, fit_of, sound};
use crate::{Estimator, FitOptions, Order, Sign, TaxelModel};

const WORST_STEP: &str = "largest step against the taxel's sign over half counts, kPa";

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for order in [5, 9] {
        cases.push(Case {
            limit: 1e-12,
            flags: &["not_monotone"],
            ..Case::exact(format!("3.1.{order}"), format!("inverse law C = 255 / (P + 1), order {order}"), move || {
                against_exact(&inverse_law(), order).1
            })
        });
    }
    let estimators = [(Estimator::PerSample, "per sample"), (Estimator::PressureBinned, "pressure-binned")];
    for (k, (estimator, words)) in (1..).zip(estimators) {
        for order in [5, 9] {
            let name = format!("inverse law, repaired, {words}, order {order}");
            cases.push(Case {
                expected: "interval_too_wide",
                figure: WORST_STEP,
                limit: 0.0,
                flags: &["repaired"],
                also: "lack of fit F above 3",
                ..Case::exact(format!("3.2.{k}.{order}"), name, move || repaired(order, estimator))
            });
        }
    }
    cases.push(Case {
        figure: WORST_STEP,
        limit: 0.0,
        also: "sign is rising, readings are those of the falling skin mirrored to 1e-9 kPa",
        ..Case::exact("3.3", "reversed sign: counts rise with pressure", reversed)
    });
    cases.extend([
        Case {
            expected: "interval_too_wide",
            figure: "usable tables",
            limit: 0.0,
            ..Case::exact("3.4", "a count that means two pressures: counts fall and rise again", || {
                unusable(|share| 200.0 - 60.0 * (share * std::f64::consts::PI).sin())
            })
        },
        Case {
            expected: "not_monotone",
            figure: "usable tables",
            limit: 0.0,
            ..Case::exact("3.5", "counts that jump: the highest pressure lies between two lower ones", || {
                unusable(|share| match share {
                    s if s < 0.3 => 200.0 + 10.0 * s,
                    s if s < 0.65 => 235.0 + 10.0 * s,
                    s => 215.0 + 10.0 * s,
                })
            })
        },
    ]);
    cases
}

fn inverse_law() -> Recording {
    let mut random = random(12);
    Recording::new((0..3000).map(|k| {
        let kpa = 70.0 * f64::from(k) / 3000.0;
        ((255.0 / (kpa + 1.0) + 0.5 * normal(&mut random)).round().clamp(0.0, 255.0), kpa)
    }))
}

fn repaired(order: u8, estimator: Estimator) -> Outcome {
    let options = FitOptions { order: Order::Fixed(order), estimator, ..FitOptions::default() };
    let model = fit_of(&inverse_law(), &options);
    let mut outcome = sound(&inverse_law(), &options, &model);
    outcome.figure = worst_step(&model);
    let lack = model.quality.lack_of_fit_f;
    outcome.require(lack.is_some_and(|f| f > 3.0), || format!("lack of fit F is {lack:?}"));
    outcome
}

fn reversed() -> Outcome {
    let falling = NOMINAL.ramp(3000, 19);
    let rising = falling.with_counts(|count| 255.0 - count);
    let options = FitOptions::default();
    let (model, mirror) = (fit_of(&rising, &options), fit_of(&falling, &options));
    let mut outcome = sound(&rising, &options, &model);
    outcome.require(model.sign == Sign::Rising, || format!("{:?}", model.sign));
    for count in &rising.counts {
        let (one, other) = (evaluate(&model, *count), evaluate(&mirror, 255.0 - count));
        outcome.require((one - other).abs() <= 1e-9, || format!("{one} and {other} at {count}"));
    }
    outcome.figure = worst_step(&model);
    outcome
}

/// A taxel whose count is `law` of the pressure's share of 70 kPa, with noise.
fn unusable(law: impl Fn(f64) -> f64) -> Outcome {
    let mut random = random(34);
    let recording = Recording::new((0..3000).map(|k| {
        let share = f64::from(k) / 3000.0;
        ((law(share) + 0.7 * normal(&mut random)).round(), 70.0 * share)
    }));
    let model = fit_of(&recording, &FitOptions::default());
    let usable = model.tabulate(0.0).usable;
    Outcome { figure: f64::from(u8::from(usable)), ..sound(&recording, &FitOptions::default(), &model) }
}

fn worst_step(model: &TaxelModel) -> f64 {
    let Some([low, high]) = model.range else { return f64::NAN };
    let mut worst = 0.0_f64;
    let mut last = f64::NAN;
    // A little beyond the range too, where the value is held.
    for step in -4..=(2.0 * (high - low)) as i32 + 4 {
        let kpa = evaluate(model, low + f64::from(step) / 2.0);
        if last.is_finite() {
            worst = worst.max((last - kpa) * model.sign.as_f64());
        }
        last = kpa;
    }
    worst
}
