//! One constant lag between two clocks, for recordings whose pressure carries no time of its own.

use taxel_model::{Estimator, FitOptions, Samples, fit};

use crate::recording::{Masks, Scans, mean};

/// Steps on each side of zero in which the lag is looked for.
const STEPS: i32 = 40;

/// Largest share of masked scans of a taxel that speaks for the lag.
const MASKED_MAX: f64 = 0.01;

/// The lag within `max_s` by which the pressure follows the counts, in seconds: where the mean count of the sound taxels
/// explains the pressure best. 0 if no taxel is sound.
pub(super) fn estimate(scans: &Scans<'_>, kpa: &[f64], masks: &Masks, max_s: f64) -> f64 {
    let sound: Vec<usize> = (0..scans.counts.len()).filter(|&t| masks.share(t) <= MASKED_MAX).collect();
    let counts: Vec<f64> = (0..scans.len()).map(|i| mean(sound.iter().map(|&t| scans.counts[t][i])).0).collect();
    let options = FitOptions { estimator: Estimator::PerSample, ..FitOptions::default() };
    let error = |lag_s: f64| {
        let kpa = shifted(scans.time_s, kpa, lag_s);
        let model = fit(&Samples::new(&counts, &kpa), &options);
        if model.curve.is_some() { model.quality.rmse_kpa } else { f64::INFINITY }
    };
    let candidates = (-STEPS..=STEPS).map(|step| max_s * f64::from(step) / f64::from(STEPS));
    let scored = candidates.map(|lag| (lag, error(lag)));
    // Of equals the one next to zero.
    let best = scored.min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.abs().total_cmp(&b.0.abs())));
    best.filter(|(_, error)| error.is_finite()).map_or(0.0, |(lag, _)| lag)
}

/// The pressure that belongs to each scan if the gauge's times are `lag_s` late, linear between its readings.
pub(super) fn shifted(time_s: &[f64], kpa: &[f64], lag_s: f64) -> Vec<f64> {
    if lag_s == 0.0 {
        return kpa.to_vec();
    }
    let at = |t: f64| {
        let after = time_s.partition_point(|s| *s < t);
        if after == 0 || after >= time_s.len() {
            return f64::NAN;
        }
        let share = (t - time_s[after - 1]) / (time_s[after] - time_s[after - 1]);
        kpa[after - 1] + share * (kpa[after] - kpa[after - 1])
    };
    time_s.iter().map(|t| at(t + lag_s)).collect()
}
