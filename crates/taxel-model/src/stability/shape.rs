//! Group 3: curves that are not monotone say so, whichever way the skin answers.

use crate::stability::case::{Case, Outcome, greatest};
use crate::stability::taxels::{NOMINAL, Recording, normal, random};
use crate::stability::trial::{against_exact, evaluate, fit_of, sound};
use crate::{FitOptions, Sign};

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
    cases.push(Case {
        figure: "max |P - mirrored P|, kPa",
        limit: 1e-9,
        also: "sign is rising",
        ..Case::exact("3.2", "reversed sign: counts rise with pressure", reversed)
    });
    cases
}

fn inverse_law() -> Recording {
    let mut random = random(12);
    Recording::new((0..3000).map(|k| {
        let kpa = 70.0 * f64::from(k) / 3000.0;
        ((255.0 / (kpa + 1.0) + 0.5 * normal(&mut random)).round().clamp(0.0, 255.0), kpa)
    }))
}

fn reversed() -> Outcome {
    let falling = NOMINAL.ramp(3000, 19);
    let rising = falling.with_counts(|count| 255.0 - count);
    let options = FitOptions::default();
    let (model, mirror) = (fit_of(&rising, &options), fit_of(&falling, &options));
    let mut outcome = sound(&rising, &options, &model);
    outcome.require(model.sign == Sign::Rising, || format!("{:?}", model.sign));
    let differences = rising.counts.iter().map(|count| evaluate(&model, *count) - evaluate(&mirror, 255.0 - count));
    outcome.figure = greatest(differences.map(f64::abs));
    outcome
}
