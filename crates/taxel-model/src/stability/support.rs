//! Group 2: too few counts, too few samples, too much noise, no change at all: what the samples do not carry must be said.

use crate::stability::case::{Case, Outcome, greatest};
use crate::stability::taxels::{NOMINAL, Recording, Taxel, random};
use crate::stability::trial::{against_exact, evaluate, fit_of, sound};
use crate::{FitOptions, Status, TaxelModel};
use rand::RngExt;

pub(super) fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = (2..=7).map(stiff).collect();
    cases.push(Case {
        flags: &["few_distinct_counts"],
        limit: 1e-12,
        also: "half-width of the 95 % interval above 20 % of the range",
        ..Case::exact("2.2", "stiff dielectric with noise: a swing of 3 counts", || {
            let (model, mut outcome) = against_exact(&Taxel { gain: 4.0, ..NOMINAL }.ramp(2000, 3), 5);
            require_wide(&model, &mut outcome);
            outcome
        })
    });
    cases.extend((1..=6).map(few_samples));
    cases.extend(noise());
    cases.extend(stuck());
    cases.push(Case {
        flags: &["gap"],
        limit: 1e-12,
        also: "sigma in the gap above 3 times sigma in the clusters",
        ..Case::exact("2.6", "two clusters of counts with a gap between them", clusters)
    });
    cases.push(Case {
        expected: "no_excitation",
        figure: "curves given",
        limit: 0.0,
        also: "no calibration is emitted",
        ..Case::exact("2.7", "no excitation: all pressures are equal", no_excitation)
    });
    cases.push(Case {
        expected: "no_excitation",
        figure: "curves given",
        limit: 0.0,
        ..Case::exact("2.8", "no excitation: the pressure varies by 5 times the gauge's noise", within_gauge_noise)
    });
    cases
}

/// The law of the sound taxel, but so stiff that only `codes` counts are seen; no noise.
fn stiff(codes: u8) -> Case {
    // A swing of codes - 1 at 70 kPa, which is 7 / 11 of the gain.
    let gain = f64::from(codes - 1) * 11.0 / 7.0;
    let flags: &[&str] = if codes < 6 { &["rank_reduced", "few_distinct_counts"] } else { &["few_distinct_counts"] };
    let name = format!("stiff dielectric, no noise: {codes} distinct counts, order 5 asked for");
    Case {
        flags,
        also: "rank is the number of distinct counts, 6 at most",
        ..Case::exact(format!("2.1.{codes}"), name, move || {
            let (model, mut outcome) = against_exact(&Taxel { gain, noise: 0.0, ..NOMINAL }.ramp(2000, 2), 5);
            let quality = &model.quality;
            outcome.require(quality.distinct_counts == u32::from(codes), || {
                format!("{} distinct counts", quality.distinct_counts)
            });
            outcome.require(quality.rank == codes.min(6), || format!("rank is {}", quality.rank));
            outcome
        })
    }
}

/// As many samples as coefficients or fewer: the curve goes through all of them and proves nothing.
fn few_samples(samples: u32) -> Case {
    Case {
        expected: "unproven",
        figure: "max |dP| / max |P| at the samples, which the curve must meet",
        also: "no degree of freedom, no interval",
        ..Case::exact(format!("2.3.{samples}"), format!("order 5 from K = {samples}"), move || {
            let recording = Recording::new((0..samples).map(|k| {
                let k = f64::from(k);
                (240.0 - 7.0 * k - k * k, 1.5 * k + 0.1)
            }));
            let (model, mut outcome) = against_exact(&recording, 5);
            let most = greatest(recording.kpa.iter().copied());
            let misses = recording.pairs().map(|(count, kpa)| (evaluate(&model, count) - kpa).abs() / most);
            outcome.figure = greatest(misses);
            outcome.require(model.status == Status::Unproven { samples: u64::from(samples) }, || {
                format!("{:?}", model.status)
            });
            let proven = model.sigma.is_some() || model.quality.interval_kpa.is_some() || model.quality.dof > 0.0;
            outcome.require(!proven, || "there is an interval".to_owned());
            outcome
        })
    }
}

fn noise() -> [Case; 2] {
    let all_noise = || Taxel { gain: 0.0, noise: 3.0, ..NOMINAL }.ramp(3000, 17);
    [
        Case {
            limit: 1e-12,
            also: "half-width of the 95 % interval above 20 % of the range",
            ..Case::exact("2.4", "noise without signal, order 5", move || {
                let (model, mut outcome) = against_exact(&all_noise(), 5);
                require_wide(&model, &mut outcome);
                outcome
            })
        },
        Case {
            flags: &["rank_reduced"],
            figure: "|P - mean P| at a count, kPa",
            limit: 1.0,
            ..Case::exact("2.5", "every pressure sees the same two counts equally often", || {
                let recording = Recording::new((0..2000).map(|k| (f64::from(200 + k % 2), f64::from(k / 2) * 0.07)));
                let model = fit_of(&recording, &FitOptions::default());
                let figure = (evaluate(&model, 200.0) - 34.965).abs();
                Outcome { figure, ..sound(&recording, &FitOptions::default(), &model) }
            })
        },
    ]
}

/// A taxel that never changes: on no rail, and on one.
fn stuck() -> [Case; 2] {
    [(1, 200.0), (2, 0.0)].map(|(number, count)| Case {
        expected: "dead",
        figure: "|P - mean P|, kPa",
        limit: 0.0,
        also: "the interval is infinite",
        ..Case::exact(format!("2.9.{number}"), format!("constant taxel at count {count}"), move || stuck_at(count))
    })
}

fn stuck_at(count: f64) -> Outcome {
    let recording = Recording::new((0..100).map(|k| (count, f64::from(k))));
    let options = FitOptions::default();
    let model = fit_of(&recording, &options);
    let mut outcome = sound(&recording, &options, &model);
    outcome.require(model.status == Status::Dead { count }, || format!("{:?}", model.status));
    outcome.figure = (evaluate(&model, count) - 49.5).abs();
    let sigma = model.evaluate(count).map(|reading| reading.sigma_kpa);
    outcome.require(sigma == Some(f64::INFINITY), || format!("sigma is {sigma:?}"));
    outcome.require(!model.is_usable(), || "the model is usable".to_owned());
    outcome
}

fn require_wide(model: &TaxelModel, outcome: &mut Outcome) {
    let share = model.quality.interval_share;
    outcome.require(share.is_some_and(|share| share > 0.2), || format!("the interval is {share:?} of the range"));
}

fn clusters() -> Outcome {
    let mut random = random(18);
    let recording = Recording::new((0..600).map(|k| {
        let kpa = if k % 2 == 0 { random.random_range(0.0..8.0) } else { random.random_range(55.0..70.0) };
        (NOMINAL.read(kpa, &mut random), kpa)
    }));
    let (model, mut outcome) = against_exact(&recording, 5);
    let sigma = |count| model.evaluate(count).map_or(f64::NAN, |reading| reading.sigma_kpa);
    outcome.require(sigma(200.0) > 3.0 * sigma(232.0), || format!("sigma {} and {}", sigma(200.0), sigma(232.0)));
    outcome
}

fn no_excitation() -> Outcome {
    let recording = Recording::new((0..500).map(|k| (f64::from(200 + k % 7), 12.5)));
    without_curve(&recording, &FitOptions::default())
}

fn within_gauge_noise() -> Outcome {
    let mut options = FitOptions::default();
    options.gauge.noise_kpa = 0.1;
    let recording = Recording::new((0..500).map(|k| (f64::from(200 + k % 7), 12.0 + f64::from(k % 8) / 4.5)));
    without_curve(&recording, &options)
}

fn without_curve(recording: &Recording, options: &FitOptions) -> Outcome {
    let model = fit_of(recording, options);
    let mut outcome = sound(recording, options, &model);
    outcome.figure = f64::from(u8::from(model.curve.is_some()));
    outcome.require(model.raw_coefficients.is_empty(), || "there are coefficients".to_owned());
    outcome.require(model.evaluate(203.0).is_none(), || "there is a reading".to_owned());
    outcome
}
