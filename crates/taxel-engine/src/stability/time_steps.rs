//! Group 8: what has a memory in time, over time steps of every length: the mean that plays follow live.

use crate::baseline::TaxelBaseline;
use crate::force::hysteresis::Hysteresis;
use crate::model_set::{ModelSet, Recorded, RecordedTaxel};
use rand::RngExt;
use std::sync::Arc;
use taxel_model::stability::case::greatest;
use taxel_model::stability::case::{Case, Outcome};
use taxel_model::stability::taxels::random;
use taxel_model::{FitOptions, Plays, Samples, fit};
use taxel_skin::Time;

const REST: TaxelBaseline = TaxelBaseline { mean: 240.0, noise: 0.9 };
const SECOND_NS: i64 = 1_000_000_000;
const HOUR_NS: i64 = 3_600 * SECOND_NS;
/// Sum of weight x radius of the plays here: what they add lies between twice that below 0 and 0.
const REACH_KPA: f64 = 0.8 * 4.0 + 0.4 * 10.0;

pub(super) fn cases() -> Vec<Case> {
    vec![
        Case::of("8.6", "plays live: one step of 0.2 s against 10,000 of 20 us", "max |dP|, kPa", 1e-4, subdivision),
        Case::of(
            "8.7",
            "plays live: any counts over steps of -1 h to 1 h",
            "max |offset + sum w r| over sum w r",
            1.0 + 1e-6,
            any_steps_of_plays,
        ),
        Case::of("8.8", "plays live: after a gap of 1 h as after 1 h of scans", "max |dP|, kPa", 1e-4, after_a_gap),
    ]
}

/// Mostly short steps, and now and then one of none, of an hour, or back by an hour.
fn steps(seed: u64, n: u32) -> impl Iterator<Item = (i64, u16)> {
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

/// One taxel whose counts fall by one a kilopascal, with its hysteresis compensated over half a second.
fn hysteresis() -> Option<Hysteresis> {
    let kpa: Vec<f64> = (0..700).map(|k| f64::from(k) / 10.0).collect();
    let counts: Vec<f64> = kpa.iter().map(|kpa| (REST.mean - kpa).round()).collect();
    let model = fit(&Samples::new(&counts, &kpa), &FitOptions::default());
    let plays = Plays {
        range: model.range?,
        sign: model.sign,
        radii_counts: [4.0, 10.0, 0.0, 0.0],
        weights_kpa: [0.8, 0.4, 0.0, 0.0],
        slack_counts: 0.0,
    };
    let taxel = RecordedTaxel { sensitivity: 1.0, plays: Some(plays) };
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
        dead_zone_kpa: 0.0,
        taxels: vec![model],
        recorded: Some(Recorded {
            smooth_s: 0.5,
            plays_mean_s: 0.0,
            module_size: 1,
            zero_return_counts: None,
            unloading_share: Some(0.1),
            plays_error_ratio: Some(0.5),
            taxels: vec![Some(taxel)],
        }),
        recalibrated: None,
        maker: crate::model_set::Maker::default(),
    };
    Hysteresis::new(&Arc::new(set), &[REST])
}

/// The offset in kPa after a count that lasts until each of the times, seen first at time 0; NaN without a hysteresis.
fn offset_kpa(count: u16, times_ns: impl IntoIterator<Item = i64>) -> f64 {
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
        hysteresis.offset_kpa().first().map_or(f64::NAN, |offset| (f64::from(*offset) + REACH_KPA).abs()) / REACH_KPA
    })))
}

fn after_a_gap() -> Outcome {
    let all = offset_kpa(200, (1..=36_000).map(|k| k * HOUR_NS / 36_000));
    Outcome::of_figure((offset_kpa(200, [HOUR_NS]) - all).abs())
}
