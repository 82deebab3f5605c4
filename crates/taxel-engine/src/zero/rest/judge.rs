//! The test of rest.

use std::ops::Range;

use super::limits::{
    DRIFT_MAX, DRIFT_PER_MINUTE_MAX, DRIFT_SINCE_ZERO_MAX, HALF_MODULE_MAX, JUMPS, MOVED_AWAY_MAX,
    MOVED_FEW_FROM_ZERO_MAX, MOVED_FEW_MAX, MOVED_MEDIAN_MAX, MOVED_MODULE_MAX, NOISE_MIN_COUNTS, NOISE_RATIO_MAX,
    SCANS_MIN, STANDARD_ERRORS, STANDING, STEADY_COUNTS_MAX, STEADY_ERRORS_MAX, TAXELS_PER_BROKEN, THIRD_ERRORS_MAX,
    THIRD_NOISE_MAX, UNLIKENESS_MAX,
};
use super::moves::{Moves, greatest};
use super::statistics::{INDEPENDENT_SHARE, RestStatistics};
use super::verdict::{Beyond, RestVerdict, Unsteadiness};
use super::window::RestWindow;
use crate::baseline::TaxelBaseline;
use crate::statistics::{median, median_error};

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
    let drifts = window.all().drift();
    let (drift, noise) = (of_median(&|t| drifts[t]), of_median(&|t| seen[t].noise));
    let limit = DRIFT_MAX + STANDARD_ERRORS * drift_error(noise, scans, sound);
    if drift.abs() > limit {
        return RestVerdict::Restless(Beyond { module: None, seen: drift, limit });
    }
    if let Some(moved) = came_or_went(window, &seen, reference.models, &moves) {
        return moved;
    }
    let Some(models) = reference.models else { return RestVerdict::Unproven { taxels: sound, drift, noise } };
    let noise_ratio = of_median(&|t| seen[t].noise / known_noise(&models[t]));
    if noise_ratio > NOISE_RATIO_MAX {
        return RestVerdict::Trembling(noise_ratio);
    }
    let (median, modules) = (moves.median(), window.modules());
    let (module, moved) = moves.worst_module(modules, median.max(0.0));
    loaded(&moves, modules, median, (module, moved))
        .or_else(|| loaded_since_zero(window, &seen, reference))
        .or_else(|| standing(window, &seen, models, &moves, reference.sign))
        .unwrap_or(RestVerdict::Rest { median, worst: module.map(|module| (module, moved)) })
}

fn known_noise(taxel: &TaxelBaseline) -> f64 {
    taxel.noise.max(NOISE_MIN_COUNTS)
}

/// Whether something came or went while the skin was watched: module by module, the first half against the second, and
/// the noise against what it is known to be.
fn came_or_went(
    window: &RestWindow,
    seen: &[TaxelBaseline],
    models: Option<&[TaxelBaseline]>,
    moves: &Moves,
) -> Option<RestVerdict> {
    let [before, after] = window.halves().each_ref().map(RestStatistics::baseline);
    let share = window.halves_error();
    // Without models the quieter half says what a taxel's noise is.
    let known = |t: usize| {
        let noise = models.map_or_else(|| before[t].noise.min(after[t].noise), |models| models[t].noise);
        if noise.is_finite() { noise.max(NOISE_MIN_COUNTS) } else { f64::NAN }
    };
    let both_halves = window.has_both_halves();
    let moved = |t: usize| after[t].mean - before[t].mean;
    let jumps = |t: &usize| {
        let least = (STEADY_ERRORS_MAX * known(*t) * share).max(STEADY_COUNTS_MAX);
        moves.has(*t) && moved(*t).abs() > least
    };
    if both_halves && let Some((module, what)) = too_many(window.modules(), jumps) {
        return Some(RestVerdict::Unsteady(module, what));
    }
    let unsteady = |(module, range): (usize, &Range<usize>)| {
        let taxels = || range.clone().filter(|&t| moves.has(t));
        let third = |of: &dyn Fn(usize) -> f64| greatest(&taxels().map(of).collect::<Vec<_>>(), 2);
        let noise = third(&|t| seen[t].noise / known(t)).filter(|ratio| *ratio > THIRD_NOISE_MAX);
        let errors = || third(&|t| (moved(t) / (known(t) * share)).abs()).filter(|errors| *errors > THIRD_ERRORS_MAX);
        let middle = || {
            let (middle, noise) = (median(taxels().map(moved))?.abs(), median(taxels().map(known))?);
            let limit = HALF_MODULE_MAX + STANDARD_ERRORS * median_error(noise * share, taxels().count());
            (middle > limit).then_some(Unsteadiness::Median(middle, limit))
        };
        let found = noise.map(Unsteadiness::Noise).or_else(|| {
            let errors = both_halves.then(errors).flatten().map(Unsteadiness::Third);
            errors.or_else(|| both_halves.then(middle).flatten())
        });
        found.map(|what| RestVerdict::Unsteady(module, what))
    };
    window.modules().iter().enumerate().find_map(unsteady).or_else(|| {
        let seen = window.unlikeness().filter(|unlike| *unlike > UNLIKENESS_MAX)?;
        Some(RestVerdict::Unlike(Beyond { module: None, seen, limit: UNLIKENESS_MAX }))
    })
}

/// The module with most taxels that moved by far more than their noise, if these are too many to be broken ones.
fn too_many(modules: &[Range<usize>], jumps: impl Fn(&usize) -> bool) -> Option<(usize, Unsteadiness)> {
    let jumped = modules.iter().map(|range| range.clone().filter(&jumps).count());
    let (skin, taxels) = (jumped.clone().sum::<usize>(), modules.iter().map(ExactSizeIterator::len).sum::<usize>());
    let (module, most) = jumped.enumerate().max_by_key(|&(_, jumped)| jumped)?;
    if most >= JUMPS {
        return Some((module, Unsteadiness::Jumps(most)));
    }
    (skin >= JUMPS + taxels / TAXELS_PER_BROKEN).then_some((module, Unsteadiness::JumpsOfSkin(skin)))
}

/// Where a still skin lies further towards load than since the calibration days move it, or away from load; `median` is how far
/// the median taxel does, `worst` the module that does beyond that.
fn loaded(
    moves: &Moves,
    modules: &[Range<usize>],
    median: f64,
    (module, moved): (Option<usize>, f64),
) -> Option<RestVerdict> {
    if moved > MOVED_MODULE_MAX {
        return Some(RestVerdict::Loaded(Beyond { module, seen: moved, limit: MOVED_MODULE_MAX }));
    }
    if median > MOVED_MEDIAN_MAX {
        return Some(RestVerdict::Loaded(Beyond { module: None, seen: median, limit: MOVED_MEDIAN_MAX }));
    }
    let few = loaded_in_part(moves, modules, median.max(0.0), MOVED_FEW_MAX);
    few.or_else(|| (median < -MOVED_AWAY_MAX).then_some(RestVerdict::OtherZero(-median)))
}

/// Why the skin is not at rest by the zero that holds now, if it is not: that one knows of no other day, only of
/// temperature, which moves all taxels alike and slowly, and of what hysteresis leaves.
fn loaded_since_zero(window: &RestWindow, seen: &[TaxelBaseline], reference: Reference<'_>) -> Option<RestVerdict> {
    let (zero, minutes) = reference.zero?;
    let moves = Moves::between(zero, seen, window.all().count(), reference.sign);
    let drift_max = (DRIFT_MAX + DRIFT_PER_MINUTE_MAX * minutes.max(0.0)).min(DRIFT_SINCE_ZERO_MAX);
    let common = moves.median().clamp(0.0, drift_max);
    let enough = moves.are_enough();
    enough.then(|| loaded_in_part(&moves, window.modules(), common, MOVED_FEW_FROM_ZERO_MAX)).flatten()
}

/// Whether three or two taxels of a module moved further towards load beyond `common` than a skin at rest does; the limits
/// are that of the second and that of the third.
fn loaded_in_part(moves: &Moves, modules: &[Range<usize>], common: f64, limits: [f64; 2]) -> Option<RestVerdict> {
    [(3, limits[1]), (2, limits[0])].into_iter().find_map(|(taxels, limit)| {
        let (module, seen) = moves.worst_few(modules, common, taxels - 1);
        (seen > limit).then_some(RestVerdict::LoadedInPart(taxels as u8, Beyond { module, seen, limit }))
    })
}

/// The module with most taxels that take no part and stand still far towards load, if that may be a load beyond their range:
/// one of them may be broken. Of a module that is hardly read nothing is known, and its force says so.
fn standing(
    window: &RestWindow,
    seen: &[TaxelBaseline],
    models: &[TaxelBaseline],
    moves: &Moves,
    sign: &[i8],
) -> Option<RestVerdict> {
    let (faulty, limit) = (window.faulty().baseline(), MOVED_FEW_MAX[0]);
    let far = |t: &usize| {
        let (t, stands) = (*t, if seen[*t].mean.is_finite() { seen[*t] } else { faulty[*t] });
        let still = !moves.has(t) && stands.noise <= THIRD_NOISE_MAX * known_noise(&models[t]);
        still && f64::from(sign[t].signum()) * (stands.mean - models[t].mean) > limit
    };
    let read = window.modules().iter().enumerate().filter(|(_, range)| moves.are_enough_of(range));
    let of_modules = read.map(|(module, range)| (module, range.clone().filter(far).count()));
    let (module, taxels) = of_modules.max_by_key(|found| found.1)?;
    let beyond = Beyond { module: Some(module), seen: limit, limit };
    (taxels >= STANDING).then_some(RestVerdict::Standing(taxels, beyond))
}

/// Standard error of the median over `taxels` of the drift over `scans` scans: of a slope times the window's length
/// it is sqrt(12 / n), of a median 1.25 times that of a mean; half of the scans repeat a conversion.
pub(super) fn drift_error(noise: f64, scans: u64, taxels: usize) -> f64 {
    median_error(noise * (12.0 / (INDEPENDENT_SHARE * scans as f64)).sqrt(), taxels)
}
