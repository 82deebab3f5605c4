//! One constant lag between gauge and counts: told of sessions.

use std::ops::Range;

use taxel_model::{FitOptions, Samples, fit};

use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::scans::Scans;
use crate::statistics::mean;

/// Steps on each side of zero in which the lag is looked for at first ...
const COARSE: i32 = 8;

/// ... and parts of such a step in which it is then told.
const FINE: i32 = 5;

/// Largest share of masked scans of a taxel that speaks for the lag.
const MASKED_MAX: f64 = 0.01;

/// The lag within `max_s` by which the pressure follows the counts, in seconds: where the mean count of the sound taxels
/// explains the pressure best. 0 if no taxel is sound.
///
/// At a steady rate hysteresis looks like a lag of the counts, a negative one here, of half its width over the rate:
/// only what goes beyond that is a lag of the clocks.
pub(crate) fn estimate(scans: &Scans<'_>, kpa: &[f64], masks: &Masks, stretches: &[Range<usize>], max_s: f64) -> f64 {
    let counts = mean_counts(scans, masks);
    // Every lag is judged by the same scans: those that have a pressure at the ends of the search.
    let ends = [max_s, -max_s].map(|lag_s| shifted(scans.time_s, kpa, lag_s, stretches));
    let judged = |i: usize| ends.iter().all(|kpa| kpa[i].is_finite());
    let error = |lag_s: f64| {
        let mut kpa = shifted(scans.time_s, kpa, lag_s, stretches);
        kpa.iter_mut().enumerate().filter(|(i, _)| !judged(*i)).for_each(|(_, p)| *p = f64::NAN);
        let model = fit(&Samples::new(&counts, &kpa), &FitOptions::default());
        if model.curve.is_some() { model.quality.rmse_kpa } else { f64::INFINITY }
    };
    let coarse = best((-COARSE..=COARSE).map(|step| max_s * f64::from(step) / f64::from(COARSE)), &error);
    let step_s = max_s / f64::from(COARSE * FINE);
    let near = (-FINE..=FINE).map(|step| coarse + step_s * f64::from(step)).filter(|lag| lag.abs() <= max_s);
    best(near, &error)
}

/// Mean count of the taxels that are sound nearly throughout, one per scan; NaN without any.
pub(crate) fn mean_counts(scans: &Scans<'_>, masks: &Masks) -> Vec<f64> {
    let sound: Vec<usize> = (0..scans.counts.len()).filter(|&t| masks.share(t) <= MASKED_MAX).collect();
    (0..scans.len()).map(|i| mean(sound.iter().map(|&t| scans.counts[t][i])).0).collect()
}

/// The candidate of least error, of equals the one next to zero; 0 if none can be judged.
fn best(candidates: impl Iterator<Item = f64>, error: &dyn Fn(f64) -> f64) -> f64 {
    let scored = candidates.map(|lag| (lag, error(lag))).filter(|(_, error)| error.is_finite());
    scored.min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.abs().total_cmp(&b.0.abs()))).map_or(0.0, |(lag, _)| lag)
}

/// The pressure that belongs to each scan if the gauge's times are `lag_s` late, linear between its readings; NaN where
/// that lies beyond the scan's own stretch.
pub(crate) fn shifted(time_s: &[f64], kpa: &[f64], lag_s: f64, stretches: &[Range<usize>]) -> Vec<f64> {
    if lag_s == 0.0 {
        return kpa.to_vec();
    }
    let mut all = vec![f64::NAN; kpa.len()];
    for stretch in stretches {
        let (time_s, kpa) = (&time_s[stretch.clone()], &kpa[stretch.clone()]);
        let at = |t: f64| {
            let after = time_s.partition_point(|s| *s < t);
            if after == 0 || after >= time_s.len() {
                return f64::NAN;
            }
            let share = (t - time_s[after - 1]) / (time_s[after] - time_s[after - 1]);
            kpa[after - 1] + share * (kpa[after] - kpa[after - 1])
        };
        all[stretch.clone()].iter_mut().zip(time_s).for_each(|(p, t)| *p = at(t + lag_s));
    }
    all
}
