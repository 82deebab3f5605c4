//! Filters that look both ways.

use std::collections::VecDeque;

use crate::calibration::fit::scans::Scans;
use crate::statistics::half_window;

/// Running median over `width` (odd) values about each one, fewer at the ends; NaN stays NaN and is not counted.
///
/// For the gauge: it takes out single readings that are off and leaves a ramp where it is, in time and height.
pub fn running_median(values: &[f64], width: usize) -> Vec<f64> {
    let half = width / 2;
    let mut window = Vec::with_capacity(width + 1);
    let at = |i: usize| {
        if !values[i].is_finite() {
            return f64::NAN;
        }
        // The same number on both sides, or the ends of a ramp would move.
        let reach = half.min(i).min(values.len() - 1 - i);
        window.clear();
        window.extend(values[i - reach..=i + reach].iter().copied().filter(|v| v.is_finite()));
        let middle = window.len() / 2;
        *window.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    (0..values.len()).map(at).collect()
}

/// Mean over the values within `half` scans before and after each one that are finite and not `masked`; NaN where
/// there is none.
///
/// Half of a taxel's error is one count of noise, 8 to 12 kPa. A centred mean has no lag; live there is none of this.
pub fn smooth(values: &[f64], masked: &[bool], half: usize) -> Vec<f64> {
    // Sums of the values before each one, and how many; exact, as counts are integers.
    let mut before = vec![(0.0, 0_usize)];
    for (value, masked) in values.iter().zip(masked) {
        let (sum, n) = before.last().copied().unwrap_or_default();
        before.push(if value.is_finite() && !masked { (sum + value, n + 1) } else { (sum, n) });
    }
    let mean = |i: usize| {
        let (from, to) = (before[i.saturating_sub(half)], before[(i + half + 1).min(values.len())]);
        if to.1 > from.1 { (to.0 - from.0) / (to.1 - from.1) as f64 } else { f64::NAN }
    };
    (0..values.len()).map(mean).collect()
}

/// Scans on each side of a centred mean over `seconds`.
pub(super) fn half_width(scans: &Scans<'_>, seconds: f64) -> usize {
    half_window(seconds, scans.period_s())
}

/// Mean of each value that is not masked and those before it, over the last `scans` at most.
pub(crate) fn recent_means(values: &[f64], masked: &[bool], scans: usize) -> Vec<f64> {
    let mut window = VecDeque::new();
    let mean = |(value, masked): (&f64, &bool)| {
        if !masked {
            window.truncate(scans.max(1) - 1);
            window.push_front(*value);
        }
        window.iter().sum::<f64>() / window.len() as f64
    };
    values.iter().zip(masked).map(mean).collect()
}
