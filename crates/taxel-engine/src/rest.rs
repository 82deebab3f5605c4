//! Is this stretch of scans a skin at rest? Proof for the tare.
//!
//! A tare under load is the worst error a skin can make, and a moved zero the most frequent one. Between days the
//! counts at rest move to both sides, on one recorded skin by -0.7 to +0.9 (once -2.3) in the median and from -3.5 to
//! +4.2 (10th to 90th percentile); a load moves taxels to one side only. So [`judge`] refuses where the whole skin, or
//! one module more than the rest of it, has moved into the direction of load by more than a day does. Simulated from
//! those recordings, 155 taxels: 4 % of true rests refused; of uniform loads 15 % at 30 kPa, 55 % at 50, 94 % at 60,
//! 100 % from 100 kPa on; of loads on a tenth of the skin 75 % at 60 kPa, 100 % at 100.
//!
//! A lighter load cannot be told from a day's drift at one instant. It shows when it goes: [`lift`] finds that the
//! skin became lighter than its zero, from 30 kPa on, which true rests do not (0.07 counts at most against 0.9).

mod first;
mod statistics;
#[cfg(test)]
pub(crate) mod tests;
mod verdict;

pub use first::{first_baseline, judge_first};
pub use statistics::{RestStatistics, TaxelBaseline};
pub use verdict::{Lift, RestFigures, RestVerdict};

use std::ops::Range;

/// Fewest taxels of a module that may speak for it.
const MODULE_TAXELS_MIN: usize = 5;

/// Least noise, in counts, that a taxel is credited with: rounding alone makes 0.29.
const NOISE_FLOOR_COUNTS: f64 = 0.5;

/// A taxel with so much noise at rest, in counts, that reads one value for the whole window is broken, not at rest.
const LIFE_COUNTS: f64 = 0.3;

/// Fewer scans of a sound taxel may well all read the same.
const LIFE_SCANS: u64 = 10;

/// Margin for the error of a figure that was estimated from noisy scans, in its standard errors.
const STANDARD_ERRORS: f64 = 4.0;

/// Limits of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestLimits {
    /// Fewest scans.
    pub scans_min: u64,
    /// Least share of the comparable taxels that must be sound.
    pub sound_share_min: f64,
    /// Most that the median taxel may have moved into the direction of load, in counts.
    pub moved_median_max: f64,
    /// Most that a module may have moved into the direction of load beyond the median of all, in counts.
    pub moved_module_max: f64,
    /// Most that the median taxel may have moved the other way, in counts: beyond, it is another zero.
    pub moved_away_max: f64,
    /// Most that the median taxel may drift from begin to end of the window, in counts, beside what noise explains.
    pub drift_max: f64,
    /// Most that the median taxel's noise may exceed its noise at rest, as a factor.
    pub noise_ratio_max: f64,
    /// Most that the median taxel may become lighter than its zero, in counts.
    pub lift_median_max: f64,
    /// Most that a module may become lighter than its zero, in counts.
    pub lift_module_max: f64,
}

impl Default for RestLimits {
    fn default() -> Self {
        Self {
            scans_min: 10,
            sound_share_min: 1.0 / 3.0,
            moved_median_max: 3.5,
            moved_module_max: 5.0,
            moved_away_max: 10.0,
            drift_max: 0.4,
            noise_ratio_max: 2.5,
            lift_median_max: 0.75,
            lift_module_max: 1.5,
        }
    }
}

/// Judges a window of scans against the stored baseline.
///
/// `sign` is +1 where the count rises with pressure, -1 where it falls, 0 where that is unknown: such a taxel, one
/// without a value or without a reference does not take part. Without a reference nothing is proven: a still skin is
/// [`RestVerdict::Unproven`], which needs somebody who vouches for it.
#[must_use]
pub fn judge(
    now: &RestStatistics,
    reference: Option<&[TaxelBaseline]>,
    sign: &[i8],
    limits: &RestLimits,
) -> RestVerdict {
    let scans = now.count();
    if scans < limits.scans_min {
        return RestVerdict::NotEnough { scans, scans_min: limits.scans_min, sound: 0, comparable: 0 };
    }
    let baseline = now.baseline();
    let moves = match reference {
        Some(reference) => Moves::against(reference, now, sign),
        None => Moves::unsigned(&baseline),
    };
    if moves.sound == 0 || (moves.sound as f64) < limits.sound_share_min * moves.comparable as f64 {
        let (sound, comparable) = (moves.sound, moves.comparable);
        return RestVerdict::NotEnough { scans, scans_min: limits.scans_min, sound, comparable };
    }
    let drift = now.drift();
    let drift_median = median(moves.taxels().map(|t| drift[t]));
    let noise = median(moves.taxels().map(|t| baseline[t].noise));
    let drift_max = limits.drift_max + STANDARD_ERRORS * drift_error(noise, scans, moves.sound);
    if drift_median.abs() > drift_max {
        return RestVerdict::Restless {
            drift: drift_median,
            drift_max,
            noise_ratio: f64::NAN,
            noise_ratio_max: f64::NAN,
        };
    }
    let Some(reference) = reference else {
        return RestVerdict::Unproven { taxels: moves.sound, drift: drift_median, noise };
    };
    let ratio = |t: usize| baseline[t].noise / reference[t].noise.max(NOISE_FLOOR_COUNTS);
    let noise_ratio = median(moves.taxels().map(ratio));
    if noise_ratio > limits.noise_ratio_max {
        let noise_ratio_max = limits.noise_ratio_max;
        return RestVerdict::Restless { drift: drift_median, drift_max, noise_ratio, noise_ratio_max };
    }
    compare(&moves, now.modules(), drift_median, noise_ratio, limits)
}

/// Rest or not, from how far the taxels of a still skin have moved.
fn compare(moves: &Moves, modules: &[Range<usize>], drift: f64, noise_ratio: f64, limits: &RestLimits) -> RestVerdict {
    let moved_median = moves.median();
    let (worst_module, worst_module_moved) = moves.worst_module(modules, moved_median.max(0.0));
    let figures = RestFigures {
        taxels: moves.sound,
        moved_median,
        share_one_sided: moves.share_one_sided(),
        worst_module,
        worst_module_moved,
        drift,
        noise_ratio,
    };
    if moved_median > limits.moved_median_max || worst_module_moved > limits.moved_module_max {
        let (moved_median_max, moved_module_max) = (limits.moved_median_max, limits.moved_module_max);
        return RestVerdict::Loaded { figures, moved_median_max, moved_module_max };
    }
    if moved_median < -limits.moved_away_max {
        return RestVerdict::OtherZero { figures, moved_away_max: limits.moved_away_max };
    }
    RestVerdict::Rest { figures }
}

/// How much lighter than its zero the skin is now, if by more than a true zero allows: then the zero was taken under a
/// load that has gone since.
///
/// `later` is a later window of scans, as long as that of the zero; who has a whole file asks for each of its windows.
#[must_use]
pub fn lift(zero: &[TaxelBaseline], later: &RestStatistics, sign: &[i8], limits: &RestLimits) -> Option<Lift> {
    if later.count() < limits.scans_min {
        return None;
    }
    let moves = Moves::against(zero, later, sign);
    if moves.sound == 0 || (moves.sound as f64) < limits.sound_share_min * moves.comparable as f64 {
        return None;
    }
    let median = -moves.median();
    let lighter = Moves { moved: moves.moved.iter().map(|m| -m).collect(), ..moves };
    let (module, module_lift) = lighter.worst_module(later.modules(), 0.0);
    let lifted = median > limits.lift_median_max || module_lift > limits.lift_module_max;
    lifted.then_some(Lift { median, module, module_lift })
}

/// How far each taxel moved into the direction of load; NaN for one that takes no part.
struct Moves {
    moved: Vec<f64>,
    sound: usize,
    comparable: usize,
}

impl Moves {
    fn against(reference: &[TaxelBaseline], now: &RestStatistics, sign: &[i8]) -> Self {
        let mut comparable = 0;
        let (alive, now) = (now.count() < LIFE_SCANS, now.baseline());
        let mut moved = vec![f64::NAN; now.len()];
        for (((moved, now), reference), &sign) in moved.iter_mut().zip(now).zip(reference).zip(sign) {
            if sign == 0 || !reference.mean.is_finite() {
                continue;
            }
            comparable += 1;
            let lifeless = !alive && now.noise == 0.0 && reference.noise >= LIFE_COUNTS;
            if !lifeless {
                *moved = f64::from(sign.signum()) * (now.mean - reference.mean);
            }
        }
        let sound = moved.iter().filter(|m| m.is_finite()).count();
        Self { moved, sound, comparable }
    }

    fn unsigned(now: &[TaxelBaseline]) -> Self {
        let moved: Vec<f64> = now.iter().map(|t| if t.mean.is_finite() { 0.0 } else { f64::NAN }).collect();
        let sound = moved.iter().filter(|m| m.is_finite()).count();
        Self { comparable: moved.len(), moved, sound }
    }

    /// The taxels that take part.
    fn taxels(&self) -> impl Iterator<Item = usize> {
        self.moved.iter().enumerate().filter(|(_, m)| m.is_finite()).map(|(taxel, _)| taxel)
    }

    fn median(&self) -> f64 {
        median(self.moved.iter().copied())
    }

    /// Share of the taxels that moved into the direction of load at all.
    fn share_one_sided(&self) -> f64 {
        self.moved.iter().filter(|&&m| m > 0.0).count() as f64 / self.sound as f64
    }

    /// The module that moved furthest beyond `all`, and how far; `(None, 0.0)` if none did.
    fn worst_module(&self, modules: &[Range<usize>], all: f64) -> (Option<usize>, f64) {
        let mut worst = (None, 0.0);
        for (module, range) in modules.iter().enumerate() {
            let taxels = self.moved.get(range.clone()).unwrap_or_default();
            if taxels.iter().filter(|m| m.is_finite()).count() < MODULE_TAXELS_MIN {
                continue;
            }
            let beyond = median(taxels.iter().copied()) - all;
            if beyond > worst.1 {
                worst = (Some(module), beyond);
            }
        }
        worst
    }
}

/// Standard error of the median over `taxels` of the drift over `scans` scans: of a slope times the window's length
/// it is sqrt(12 / n), of a median 1.25 times that of a mean; half of the scans repeat a conversion.
fn drift_error(noise: f64, scans: u64, taxels: usize) -> f64 {
    1.25 * noise * (12.0 / (0.5 * scans as f64)).sqrt() / (taxels as f64).sqrt()
}

/// Median of the finite values; NaN without any.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut finite: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    match finite.len() {
        0 => f64::NAN,
        n => 0.5 * (finite[(n - 1) / 2] + finite[n / 2]),
    }
}
