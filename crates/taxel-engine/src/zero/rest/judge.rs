//! The test of rest.

use std::ops::Range;

use super::limits::{
    BROKEN_MAX, DRIFT_MAX, LIFT_MEDIAN_MAX, LIFT_MODULE_MAX, LIFT_THIRD_MAX, MOVED_AWAY_MAX, MOVED_FEW_FROM_ZERO_MAX,
    MOVED_FEW_MAX, MOVED_MEDIAN_MAX, MOVED_MODULE_MAX, NOISE_MIN_COUNTS, SCANS_MIN, STANDARD_ERRORS, THIRD_NOISE_MAX,
    UNLIKENESS_MAX,
};
use super::moves::{Moves, greatest};
use super::statistics::RestStatistics;
use super::verdict::{Beyond, Figure, RestVerdict};
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use crate::statistics::{median, median_error};

/// What a stretch of scans is compared with, one entry per taxel each.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference<'a> {
    /// What the models refer to, perhaps of another day.
    pub models: Option<&'a [TaxelBaseline]>,
    /// The zero that holds now, if one does.
    pub zero: Option<&'a [TaxelBaseline]>,
    /// +1 where the count rises with pressure, -1 where it falls, 0 where that is unknown: such a taxel does not take part.
    pub sign: &'a [i8],
}

/// Judges a window of scans.
///
/// A taxel without a value, a reference or a sign does not take part. Without a reference nothing is proven: a still skin
/// is [`RestVerdict::Unproven`], which needs somebody who confirms it.
pub fn judge(window: &RestWindow, reference: Reference<'_>) -> RestVerdict {
    let scans = window.all().count();
    if scans < SCANS_MIN {
        return RestVerdict::TooShort(scans);
    }
    let seen = window.all().baseline();
    let moves = match reference.models {
        Some(models) => Moves::between(models, &seen, scans, reference.sign),
        None => Moves::unsigned(&seen),
    };
    let (sound, comparable) = moves.counts();
    if !moves.are_enough() {
        return RestVerdict::TooFew { sound, comparable };
    }
    let of_median = |of: &dyn Fn(usize) -> f64| median(moves.taxels().map(of)).unwrap_or(0.0);
    let [before, after] = window.halves().each_ref().map(RestStatistics::baseline);
    // The halves are half a window apart.
    let drift = 2.0 * of_median(&|t| after[t].mean - before[t].mean);
    let noise = of_median(&|t| seen[t].noise);
    let limit = DRIFT_MAX + STANDARD_ERRORS * median_error(2.0 * noise * window.halves_error(), sound);
    if drift.abs() > limit {
        return RestVerdict::Moved(Beyond { figure: Figure::Drift, module: None, seen: drift, limit });
    }
    // Without models the quieter half says what a taxel's noise is.
    let known = |t: usize| match reference.models {
        Some(models) => known_noise(models[t].noise),
        None => known_noise(before[t].noise.min(after[t].noise)),
    };
    if let Some(moved) = came_or_went(window, &moves, |t| seen[t].noise / known(t)) {
        return RestVerdict::Moved(moved);
    }
    let Some(models) = reference.models else { return RestVerdict::Unproven { taxels: sound, drift, noise } };
    let (median, modules) = (moves.median(), window.modules());
    let common = median.max(0.0);
    let (module, moved) = moves.worst_module(modules, common);
    let pressed = Beyond::first([
        (Figure::Median, (module, moved), MOVED_MODULE_MAX),
        (Figure::Median, (None, median), MOVED_MEDIAN_MAX),
        (Figure::Taxels(3), moves.worst_few(modules, common, 2), MOVED_FEW_MAX[1]),
        (Figure::Taxels(2), moves.worst_few(modules, common, 1), MOVED_FEW_MAX[0]),
    ]);
    let pressed = pressed
        .or_else(|| loaded_since_zero(window, &seen, reference))
        .or_else(|| standing(window, &seen, models, &moves, reference.sign));
    match pressed {
        Some(beyond) => RestVerdict::Loaded(beyond),
        None if median < -MOVED_AWAY_MAX => RestVerdict::OtherZero(-median),
        None => RestVerdict::Rest { median, worst: module.map(|module| (module, moved)) },
    }
}

/// No less than rounding makes; NaN where it is not known.
fn known_noise(noise: f64) -> f64 {
    noise.clamp(NOISE_MIN_COUNTS, f64::INFINITY)
}

/// Whether something came or went on a module while the skin was watched; `noise` of a taxel is over what it is known to be.
fn came_or_went(window: &RestWindow, moves: &Moves, noise: impl Fn(usize) -> f64) -> Option<Beyond> {
    let steady = window.steady_baseline();
    let of_module = |(module, range): (usize, &Range<usize>)| {
        let taxels = || range.clone().filter(|&t| moves.has(t));
        let jumped = taxels().filter(|&t| steady[t].mean.is_nan()).count();
        let third = greatest(&taxels().map(&noise).collect::<Vec<_>>(), 2).unwrap_or(0.0);
        Beyond::first([
            (Figure::Jumps, (Some(module), jumped as f64), BROKEN_MAX),
            (Figure::Noise, (Some(module), third), THIRD_NOISE_MAX),
        ])
    };
    window
        .modules()
        .iter()
        .enumerate()
        .find_map(of_module)
        .or_else(|| Beyond::first([(Figure::Unlike, (None, window.unlikeness()?), UNLIKENESS_MAX)]))
}

/// Whether something presses by the zero that holds now: that one knows of no other day, only of temperature, which moves all taxels
/// alike, and of what hysteresis leaves.
fn loaded_since_zero(window: &RestWindow, seen: &[TaxelBaseline], reference: Reference<'_>) -> Option<Beyond> {
    let moves = Moves::between(reference.zero?, seen, window.all().count(), reference.sign);
    let (modules, common) = (window.modules(), moves.median().clamp(0.0, MOVED_MEDIAN_MAX));
    moves.are_enough().then_some(())?;
    Beyond::first([
        (Figure::Taxels(3), moves.worst_few(modules, common, 2), MOVED_FEW_FROM_ZERO_MAX[1]),
        (Figure::Taxels(2), moves.worst_few(modules, common, 1), MOVED_FEW_FROM_ZERO_MAX[0]),
    ])
}

/// The module with most taxels that take no part and stand still far towards load, if that may be a load beyond their range.
/// Of a module that is hardly read nothing is known, and its force says so.
fn standing(
    window: &RestWindow,
    seen: &[TaxelBaseline],
    models: &[TaxelBaseline],
    moves: &Moves,
    sign: &[i8],
) -> Option<Beyond> {
    let faulty = window.faulty().baseline();
    let far = |&t: &usize| {
        let stands = if seen[t].mean.is_finite() { seen[t] } else { faulty[t] };
        let still = !moves.has(t) && stands.noise <= THIRD_NOISE_MAX * known_noise(models[t].noise);
        still && f64::from(sign[t].signum()) * (stands.mean - models[t].mean) > MOVED_FEW_MAX[0]
    };
    let read = window.modules().iter().enumerate().filter(|(_, range)| moves.are_enough_of(range));
    let of_modules = read.map(|(module, range)| (Some(module), range.clone().filter(far).count() as f64));
    Beyond::first([(Figure::Standing, of_modules.max_by(|a, b| a.1.total_cmp(&b.1))?, BROKEN_MAX)])
}

/// By how much what was `seen` of each taxel in so many scans is lighter than `zero`, if that is more than a true zero allows: then that
/// was taken under a load that has gone since, or is another. True zeros of recordings stay within 0.07 counts in the median, where a
/// load of 30 kPa leaves 0.9. The window is as long as that of the zero; who has a whole file asks for each of its windows.
pub fn lighter(
    zero: &[TaxelBaseline],
    (seen, scans): (&[TaxelBaseline], u64),
    modules: &[Range<usize>],
    sign: &[i8],
) -> Option<Beyond> {
    let away: Vec<i8> = sign.iter().map(|sign| -sign).collect();
    let moves = Moves::between(zero, seen, scans, &away);
    (scans >= SCANS_MIN && moves.are_enough()).then_some(())?;
    Beyond::first([
        (Figure::Median, (None, moves.median()), LIFT_MEDIAN_MAX),
        (Figure::Median, moves.worst_module(modules, 0.0), LIFT_MODULE_MAX),
        (Figure::Taxels(3), moves.worst_few(modules, 0.0, 2), LIFT_THIRD_MAX),
    ])
}
