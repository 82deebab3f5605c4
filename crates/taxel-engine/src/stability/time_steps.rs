//! Group 8: what has a memory in time, over time steps of every length: the drift of the zero, and the mean that plays
//! follow live.

use crate::Now;
use crate::baseline::TaxelBaseline;
use crate::force::Activation;
use crate::force::hysteresis::Hysteresis;
use crate::model_set::{ModelSet, Recorded, RecordedTaxel};
use crate::plan::DriftPlan;
use crate::zero::drift::{Drift, DriftSite};
use rand::RngExt;
use std::sync::Arc;
use taxel_model::stability::case::greatest;
use taxel_model::stability::case::{Case, Outcome};
use taxel_model::stability::taxels::{normal, random};
use taxel_model::{Accumulator, FitOptions, FixedPressure, Plays};
use taxel_skin::{ModuleKind, Time};

const MODULES: usize = 8;
const TAXELS: usize = 10 * MODULES;
const REST: TaxelBaseline = TaxelBaseline { mean: 240.0, noise: 0.9 };
const PADS: f64 = 230.0;
const SECOND_NS: i64 = 1_000_000_000;
const HOUR_NS: i64 = 3_600 * SECOND_NS;
/// Sum of weight x radius of the plays here: the bend can be no greater.
const OFFSET_MAX_KPA: f64 = 0.8 * 4.0 + 0.4 * 10.0;

pub(super) fn cases() -> Vec<Case> {
    let drift = "max |difference of the drift|, counts";
    vec![
        Case::of("8.1", "drift: the same 40 minutes of warming at 20 Hz and at 4 Hz", drift, 0.5, rates),
        Case::of("8.2", "drift: scans of the same and of earlier times", drift, 0.0, not_later),
        Case::of("8.3", "drift: 100,000 steps of 1 us", drift, 0.0, microseconds),
        Case::of("8.4", "drift: a step of 1 h is a gap, what was followed stays", drift, 0.0, gap),
        Case::of(
            "8.5",
            "drift: any counts over steps of -1 h to 1 h, most of 1 us to 2 s",
            "max |drift| over its bound",
            1.0 + 1e-12,
            any_steps,
        ),
        Case::of("8.6", "plays live: one step of 0.2 s against 10,000 of 20 us", "max |dP|, kPa", 1e-4, subdivision),
        Case::of(
            "8.7",
            "plays live: any counts over steps of -1 h to 1 h",
            "max |offset| over sum w r",
            1.0 + 1e-6,
            any_steps_of_plays,
        ),
        Case::of("8.8", "plays live: after a gap of 1 h as after 1 h of scans", "max |dP|, kPa", 1e-4, after_a_gap),
    ]
}

fn now(time_ns: i64) -> Now {
    Now { time: Time::from_nanos(time_ns), wall_ns: time_ns }
}

fn followed() -> Drift {
    let site = |m: usize| DriftSite { taxels: 10 * m..10 * m + 10, kind: ModuleKind::Triangle, beside: vec![] };
    let plan = DriftPlan { follow: true, ..DriftPlan::default() };
    let activation = Activation { sigmas: 4.0, floor_counts: 2.0 };
    let mut drift = Drift::new(plan, activation, (0..MODULES).map(site).collect());
    drift.begin(now(0), &[REST; TAXELS], &[]);
    drift
}

/// What was added to the zero of each module, counts.
fn moved(drift: &Drift) -> Vec<f64> {
    drift.applied_to(&[REST; TAXELS]).iter().step_by(10).map(|taxel| taxel.mean - REST.mean).collect()
}

fn difference(one: &[f64], other: &[f64]) -> f64 {
    greatest(one.iter().zip(other).map(|(one, other)| (one - other).abs()))
}

/// Scans every `step_ns` of a skin that falls by 2 counts within 40 minutes, pads and taxels alike.
fn warmed(step_ns: i64) -> Drift {
    let (mut drift, mut random) = (followed(), random(81));
    for step in 1..=40 * 60 * SECOND_NS / step_ns {
        let warmth = 2.0 * step as f64 * step_ns as f64 / (40.0 * 60.0 * SECOND_NS as f64);
        let counts: Vec<u8> =
            (0..TAXELS).map(|_| (REST.mean - warmth + REST.noise * normal(&mut random)).round() as u8).collect();
        let pads: Vec<u8> = (0..MODULES).map(|_| (PADS - warmth + 0.4 * normal(&mut random)).round() as u8).collect();
        drift.on_scan(now(step * step_ns), &counts, |module| Some([pads[module]; 2]), |_| true);
    }
    drift
}

fn rates() -> Outcome {
    let (fast, slow) = (moved(&warmed(SECOND_NS / 20)), moved(&warmed(SECOND_NS / 4)));
    let mut outcome = Outcome::of_figure(difference(&fast, &slow));
    let least = fast.iter().fold(f64::INFINITY, |least, drift| least.min(-drift));
    outcome.require(least > 1.5, || format!("of 2 counts only {least:.2} were followed"));
    outcome
}

fn not_later() -> Outcome {
    let mut drift = warmed(SECOND_NS / 4);
    let (before, end_ns) = (moved(&drift), 40 * 60 * SECOND_NS);
    for step in 0..10_000 {
        drift.on_scan(now(end_ns - step % 7 * SECOND_NS), &[200; TAXELS], |_| Some([200; 2]), |_| true);
    }
    Outcome::of_figure(difference(&before, &moved(&drift)))
}

fn microseconds() -> Outcome {
    let mut drift = followed();
    for step in 0..100_000 {
        drift.on_scan(now(step * 1_000), &[239; TAXELS], |_| Some([229; 2]), |_| true);
    }
    Outcome::of_figure(difference(&moved(&drift), &[0.0; MODULES]))
}

fn gap() -> Outcome {
    let mut drift = warmed(SECOND_NS / 4);
    let before = moved(&drift);
    drift.on_scan(now(40 * 60 * SECOND_NS + HOUR_NS), &[236; TAXELS], |_| Some([226; 2]), |_| true);
    Outcome::of_figure(difference(&before, &moved(&drift)))
}

/// Mostly short steps, and now and then one of none, of an hour, or back by an hour.
fn steps(seed: u64, n: u32) -> impl Iterator<Item = (i64, u8)> {
    let (mut random, mut time_ns) = (random(seed), 0_i64);
    (0..n).map(move |_| {
        let step_ns = match random.random_range(0..20) {
            0 => 0,
            1 => HOUR_NS,
            2 => -HOUR_NS,
            3..8 => random.random_range(1_000..1_000_000),
            _ => random.random_range(1_000_000..2 * SECOND_NS),
        };
        time_ns += step_ns;
        (time_ns, random.random())
    })
}

fn any_steps() -> Outcome {
    let (mut drift, mut random) = (warmed(SECOND_NS / 4), random(85));
    let bound = DriftPlan::default().bound_counts;
    let largest = steps(84, 20_000).map(|(time_ns, level)| {
        let counts: Vec<u8> = (0..TAXELS).map(|_| if level < 200 { random.random() } else { 238 }).collect();
        drift.on_scan(
            now(40 * 60 * SECOND_NS + time_ns),
            &counts,
            |_| Some([level; 2]),
            |taxel| !taxel.is_multiple_of(3),
        );
        greatest(moved(&drift).into_iter().map(f64::abs)) / bound
    });
    Outcome::of_figure(greatest(largest))
}

/// One taxel whose counts fall by one a kilopascal, with its hysteresis compensated over half a second.
fn hysteresis() -> Option<Hysteresis> {
    let mut sums = Accumulator::new();
    (0..700_u32).for_each(|k| {
        let kpa = f64::from(k) / 10.0;
        sums.add((REST.mean - kpa).round() as u8, FixedPressure::from_kpa(kpa), 0);
    });
    let model = sums.fit(&FitOptions::default());
    let (curve, range) = (model.curve.clone()?, model.range?);
    let plays = Plays { curve, range, sign: model.sign, radii_counts: [4.0, 10.0], weights_kpa: [0.8, 0.4] };
    let taxel = RecordedTaxel { rmse_kpa: 1.0, sensitivity: 1.0, hysteresis_kpa: Some(7.0), plays: Some(plays) };
    let set = ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: String::new(),
        board_settings: Vec::new(),
        baseline: vec![REST],
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.0,
        gauge_offset_kpa: 0.0,
        taxels: vec![model],
        recorded: Some(Recorded {
            smooth_s: 0.5,
            module_size: 1,
            lag_s: 0.0,
            zero_return: None,
            clock: None,
            plays_error_ratio: Some(0.5),
            taxels: vec![Some(taxel)],
        }),
        recalibrated: None,
        maker: crate::model_set::Maker::default(),
    };
    Hysteresis::new(&Arc::new(set), &[REST])
}

/// The offset in kPa after a count that lasts until each of the times, seen first at time 0; NaN without a hysteresis.
fn offset_kpa(count: u8, times_ns: impl IntoIterator<Item = i64>) -> f64 {
    let Some(mut hysteresis) = hysteresis() else { return f64::NAN };
    for time_ns in std::iter::once(0).chain(times_ns) {
        hysteresis.follow(Time::from_nanos(time_ns), &[count], |_| true);
    }
    hysteresis.offset_kpa().first().map_or(f64::NAN, |offset| f64::from(*offset))
}

fn subdivision() -> Outcome {
    let small = |count| offset_kpa(count, (1..=10_000).map(|k| k * 20_000));
    Outcome::of_figure(greatest([180, 200, 220, 235].map(|count| {
        let one = offset_kpa(count, [SECOND_NS / 5]);
        (one - small(count)).abs()
    })))
}

fn any_steps_of_plays() -> Outcome {
    let Some(mut hysteresis) = hysteresis() else { return Outcome::of_figure(f64::NAN) };
    Outcome::of_figure(greatest(steps(87, 100_000).map(|(time_ns, count)| {
        hysteresis.follow(Time::from_nanos(time_ns), &[count], |_| true);
        hysteresis.offset_kpa().first().map_or(f64::NAN, |offset| f64::from(*offset).abs()) / OFFSET_MAX_KPA
    })))
}

fn after_a_gap() -> Outcome {
    let all = offset_kpa(200, (1..=36_000).map(|k| k * HOUR_NS / 36_000));
    Outcome::of_figure((offset_kpa(200, [HOUR_NS]) - all).abs())
}
