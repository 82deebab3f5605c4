//! The test of rest.

use std::ops::Range;

use super::limits::RestLimits;
use super::moves::{Moves, third};
use super::statistics::{INDEPENDENT_SHARE, NOISE_FLOOR_COUNTS, STEADY_COUNTS_MAX, STEADY_ERRORS_MAX};
use super::unlike::UNLIKENESS_MAX;
use super::verdict::{RestFigures, RestVerdict, Unsteadiness};
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use crate::statistics::{median, median_error};

/// Margin for the error of a figure that was estimated from noisy scans, in its standard errors.
const STANDARD_ERRORS: f64 = 4.0;

/// Three of a module's taxels that all move by so many standard errors from half to half: once in 20,000 windows by
/// chance, of 23 modules with ten taxels.
const THIRD_ERRORS_MAX: f64 = 3.3;

/// Three of a module's taxels with so much more noise than they are known to have: of 20 scans once in 1e9 windows.
const THIRD_NOISE_MAX: f64 = 1.9;

/// So many taxels of a module, or of the skin, that moved by far more than their noise are a load that came or went, however
/// few of a module's taxels it lies on. One alone may be broken, and of a large skin one more for each so many.
const JUMPS_OF_MODULE: usize = 2;
const JUMPS_OF_SKIN: usize = 2;
const TAXELS_PER_BROKEN: usize = 500;

/// So many taxels of a module that stand still far towards load are a load.
const STANDING_OF_MODULE: usize = 2;

/// Most of a thermal drift that is put down to time, counts.
const DRIFT_MAX_COUNTS: f64 = 3.5;

/// What a stretch of scans is compared with, one entry per taxel each.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reference<'a> {
    /// What the models refer to, perhaps of another day.
    pub models: Option<&'a [TaxelBaseline]>,
    /// The zero that holds now, if one does, and how many minutes ago it was taken.
    pub zero: Option<(&'a [TaxelBaseline], f64)>,
    /// +1 where the count rises with pressure, -1 where it falls, 0 where that is unknown: such a taxel does not take part.
    pub sign: &'a [i8],
}

/// Judges a window of scans.
///
/// A taxel without a value, a reference or a sign does not take part. Without a reference nothing is proven: a still skin
/// is [`RestVerdict::Unproven`], which needs somebody who vouches for it.
#[must_use]
pub fn judge(window: &RestWindow, reference: Reference<'_>, limits: &RestLimits) -> RestVerdict {
    let now = window.all();
    let scans = now.count();
    if scans < limits.scans_min {
        return RestVerdict::NotEnough { scans, scans_min: limits.scans_min, sound: 0, comparable: 0 };
    }
    let baseline = now.baseline();
    let moves = match reference.models {
        Some(models) => Moves::against(models, now, reference.sign),
        None => Moves::unsigned(&baseline),
    };
    if !moves.are_enough(limits.sound_share_min) {
        let (sound, comparable) = moves.counts();
        return RestVerdict::NotEnough { scans, scans_min: limits.scans_min, sound, comparable };
    }
    let drift = now.drift();
    let drift_median = median(moves.taxels().map(|t| drift[t])).unwrap_or(0.0);
    let noise = median(moves.taxels().map(|t| baseline[t].noise)).unwrap_or(0.0);
    let drift_max = limits.drift_max + STANDARD_ERRORS * drift_error(noise, scans, moves.counts().0);
    if drift_median.abs() > drift_max {
        let (noise_ratio, noise_ratio_max) = (f64::NAN, f64::NAN);
        return RestVerdict::Restless { drift: drift_median, drift_max, noise_ratio, noise_ratio_max };
    }
    if let Some((module, what)) = unsteady(window, reference.models, &moves, limits) {
        return RestVerdict::Unsteady { module, what };
    }
    if let Some(unlikeness) = window.unlikeness().filter(|unlike| *unlike > UNLIKENESS_MAX) {
        return RestVerdict::Unlike { unlikeness, unlikeness_max: UNLIKENESS_MAX };
    }
    let Some(models) = reference.models else {
        return RestVerdict::Unproven { taxels: moves.counts().0, drift: drift_median, noise };
    };
    let ratio = |t: usize| baseline[t].noise / models[t].noise.max(NOISE_FLOOR_COUNTS);
    let noise_ratio = median(moves.taxels().map(ratio)).unwrap_or(0.0);
    if noise_ratio > limits.noise_ratio_max {
        let noise_ratio_max = limits.noise_ratio_max;
        return RestVerdict::Restless { drift: drift_median, drift_max, noise_ratio, noise_ratio_max };
    }
    match compare_with_models(&moves, window, drift_median, noise_ratio, limits) {
        rest @ RestVerdict::Rest { .. } => {
            let standing = || standing(window, models, &moves, reference.sign, limits);
            compare_with_zero(window, reference, limits).or_else(standing).unwrap_or(rest)
        }
        other => other,
    }
}

/// The module with most taxels that take no part and stand still far towards load, if that may be a load beyond their range:
/// one of them may be broken. Of a module that is hardly read nothing is known, and its force says so.
fn standing(
    window: &RestWindow,
    models: &[TaxelBaseline],
    moves: &Moves,
    sign: &[i8],
    limits: &RestLimits,
) -> Option<RestVerdict> {
    let (sound, faulty) = (window.all().baseline(), window.faulty().baseline());
    let moved_max = limits.moved_second_max;
    let far = |t: usize| {
        let stands = if moves.has(t) { &TaxelBaseline::UNKNOWN } else { known_of(&sound[t], &faulty[t]) };
        let still = stands.noise <= THIRD_NOISE_MAX * models[t].noise.max(NOISE_FLOOR_COUNTS);
        still && f64::from(sign[t].signum()) * (stands.mean - models[t].mean) > moved_max
    };
    let read = |range: &&Range<usize>| moves.are_enough_of(range);
    let of_module = |range: &Range<usize>| range.clone().filter(|&t| far(t)).count();
    let modules = window.all().modules().iter().enumerate().filter(|(_, range)| read(range));
    let (module, taxels) = modules.map(|(module, range)| (module, of_module(range))).max_by_key(|found| found.1)?;
    (taxels >= STANDING_OF_MODULE).then_some(RestVerdict::Standing { module, taxels, moved_max })
}

/// Whether something came or went while the skin was watched: module by module, the first half against the second, and
/// the noise against what it is known to be.
fn unsteady(
    window: &RestWindow,
    models: Option<&[TaxelBaseline]>,
    moves: &Moves,
    limits: &RestLimits,
) -> Option<(usize, Unsteadiness)> {
    let [early, late] = window.halves();
    let (all, before, after) = (window.all().baseline(), early.baseline(), late.baseline());
    let share = window.halves_error();
    let takes_part: Vec<bool> = {
        let mut part = vec![false; all.len()];
        moves.taxels().for_each(|taxel| part[taxel] = true);
        part
    };
    // Without models the quieter half says what a taxel's noise is.
    let known = |t: usize| {
        let noise = models.map_or_else(|| before[t].noise.min(after[t].noise), |models| models[t].noise);
        if noise.is_finite() { noise.max(NOISE_FLOOR_COUNTS) } else { f64::NAN }
    };
    let both_halves = window.has_both_halves();
    let moved = |t: usize| after[t].mean - before[t].mean;
    let jumps = |t: usize| {
        let least = (STEADY_ERRORS_MAX * known(t) * share).max(STEADY_COUNTS_MAX);
        takes_part[t] && moved(t).abs() > least
    };
    if both_halves && let Some(found) = too_many(window.all().modules(), jumps) {
        return Some(found);
    }
    for (module, range) in window.all().modules().iter().enumerate() {
        let taxels = || range.clone().filter(|&t| takes_part[t]);
        let noise: Vec<f64> = taxels().map(|t| all[t].noise / known(t)).collect();
        if let Some(ratio) = third(&noise).filter(|ratio| *ratio > THIRD_NOISE_MAX) {
            return Some((module, Unsteadiness::Noise(ratio, THIRD_NOISE_MAX)));
        }
        if !both_halves {
            continue;
        }
        let errors: Vec<f64> = taxels().map(|t| (moved(t) / (known(t) * share)).abs()).collect();
        if let Some(errors) = third(&errors).filter(|errors| *errors > THIRD_ERRORS_MAX) {
            return Some((module, Unsteadiness::Third(errors, THIRD_ERRORS_MAX)));
        }
        let (Some(middle), Some(noise)) = (median(taxels().map(moved)), median(taxels().map(known))) else { continue };
        let max = limits.half_module_max + STANDARD_ERRORS * median_error(noise * share, errors.len());
        if middle.abs() > max {
            return Some((module, Unsteadiness::Median(middle.abs(), max)));
        }
    }
    None
}

/// The module with most taxels that moved by far more than their noise, if these are too many to be broken ones.
fn too_many(modules: &[Range<usize>], jumps: impl Fn(usize) -> bool) -> Option<(usize, Unsteadiness)> {
    let jumped = modules.iter().map(|range| range.clone().filter(|&taxel| jumps(taxel)).count());
    let (skin, taxels) = (jumped.clone().sum::<usize>(), modules.iter().map(ExactSizeIterator::len).sum::<usize>());
    let (module, most) = jumped.enumerate().max_by_key(|&(_, jumped)| jumped)?;
    let of_module = most >= JUMPS_OF_MODULE;
    let found = if of_module { (most, false) } else { (skin, true) };
    let too_many = of_module || skin >= JUMPS_OF_SKIN + taxels / TAXELS_PER_BROKEN;
    too_many.then_some((module, Unsteadiness::Single { taxels: found.0, all: found.1 }))
}

/// What is known of a taxel by its sound readings, or else by the others.
const fn known_of<'a>(sound: &'a TaxelBaseline, faulty: &'a TaxelBaseline) -> &'a TaxelBaseline {
    if sound.mean.is_finite() { sound } else { faulty }
}

/// Rest or not, from how far the taxels of a still skin have moved since the calibration.
fn compare_with_models(
    moves: &Moves,
    window: &RestWindow,
    drift: f64,
    noise_ratio: f64,
    limits: &RestLimits,
) -> RestVerdict {
    let modules = window.all().modules();
    let moved_median = moves.median();
    let (worst_module, worst_module_moved) = moves.worst_module(modules, moved_median.max(0.0));
    let figures =
        RestFigures { taxels: moves.counts().0, moved_median, worst_module, worst_module_moved, drift, noise_ratio };
    if moved_median > limits.moved_median_max || worst_module_moved > limits.moved_module_max {
        let (moved_median_max, moved_module_max) = (limits.moved_median_max, limits.moved_module_max);
        return RestVerdict::Loaded { figures, moved_median_max, moved_module_max };
    }
    let few = [limits.moved_second_max, limits.moved_third_max];
    if let Some(loaded) = loaded_in_part(moves, modules, moved_median.max(0.0), few, false) {
        return loaded;
    }
    if moved_median < -limits.moved_away_max {
        return RestVerdict::OtherZero { figures, moved_away_max: limits.moved_away_max };
    }
    RestVerdict::Rest { figures }
}

/// Why the skin is not at rest by the zero that holds now, if it is not: that one knows of no other day, only of
/// temperature, which moves all taxels alike and slowly, and of what hysteresis leaves.
fn compare_with_zero(window: &RestWindow, reference: Reference<'_>, limits: &RestLimits) -> Option<RestVerdict> {
    let (zero, minutes) = reference.zero?;
    let moves = Moves::against(zero, window.all(), reference.sign);
    if !moves.are_enough(limits.sound_share_min) {
        return None;
    }
    let drift_max = (limits.drift_max + limits.drift_per_minute_max * minutes.max(0.0)).min(DRIFT_MAX_COUNTS);
    let common = moves.median().clamp(0.0, drift_max);
    let few = [limits.moved_second_from_zero_max, limits.moved_third_from_zero_max];
    loaded_in_part(&moves, window.all().modules(), common, few, true)
}

/// Whether two or three taxels of a module moved further towards load beyond `common` than a skin at rest does; the limits
/// are that of the second and that of the third.
fn loaded_in_part(
    moves: &Moves,
    modules: &[Range<usize>],
    common: f64,
    [second_max, third_max]: [f64; 2],
    from_zero: bool,
) -> Option<RestVerdict> {
    let found =
        [(3, moves.worst_third(modules, common), third_max), (2, moves.worst_second(modules, common), second_max)];
    let (taxels, (module, moved), moved_max) = found.into_iter().find(|(_, (_, moved), max)| moved > max)?;
    module.map(|module| RestVerdict::LoadedInPart { module, taxels, moved, moved_max, from_zero })
}

/// Standard error of the median over `taxels` of the drift over `scans` scans: of a slope times the window's length
/// it is sqrt(12 / n), of a median 1.25 times that of a mean; half of the scans repeat a conversion.
pub(super) fn drift_error(noise: f64, scans: u64, taxels: usize) -> f64 {
    median_error(noise * (12.0 / (INDEPENDENT_SHARE * scans as f64)).sqrt(), taxels)
}
