//! Medians and the like of values some of which may be missing, once for everybody.

/// The standard deviation of normal errors over their median absolute deviation.
pub const MEDIAN_DEVIATIONS: f64 = 1.4826;

/// The value at `share` (0 to 1) of the finite values in ascending order; `None` without any.
#[must_use]
pub fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    let last = values.len().checked_sub(1)?;
    let at = ((share * last as f64).round() as usize).min(last);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Median of the finite values, the mean of the middle two of an even number; `None` without any.
#[must_use]
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut finite: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    let n = finite.len();
    if n == 0 {
        return None;
    }
    let (below, &mut upper, _) = finite.select_nth_unstable_by(n / 2, f64::total_cmp);
    let greatest = || below.iter().copied().max_by(f64::total_cmp);
    let lower = if n.is_multiple_of(2) { greatest().unwrap_or(upper) } else { upper };
    Some(0.5 * (lower + upper))
}

/// Mean of the finite values and how many they are; NaN without any.
#[must_use]
pub fn mean(values: impl Iterator<Item = f64>) -> (f64, usize) {
    let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0), |(sum, n), v| (sum + v, n + 1));
    (sum / n as f64, n)
}

/// Root of the mean square of the finite values; NaN without any.
#[must_use]
pub fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    mean(values.map(|v| v * v)).0.sqrt()
}

/// Scans on each side of a centred mean over `seconds`, of scans that come every `period_s`; 0 without a period.
///
/// A thousandth of a scan short is a whole one: a median of times in nanoseconds or microseconds is a period of 50 ms but for
/// rounding, and whether four or five of them are a quarter of a second must not hang on that.
#[must_use]
pub fn half_window(seconds: f64, period_s: f64) -> usize {
    let half = 0.5 * seconds / period_s + 1e-3;
    if half.is_finite() && half > 0.0 { half as usize } else { 0 }
}

/// The share of a new value in an exponential mean with this time constant, above 0, a step after the last; exact in the step.
#[must_use]
pub fn exponential_share(step_s: f64, time_constant_s: f64) -> f64 {
    -(-step_s / time_constant_s).exp_m1()
}

/// The median of an estimate from `n` values with standard deviation `sigma` has this standard error: 1.2533 times that
/// of a mean (normal errors; Kendall and Stuart, The Advanced Theory of Statistics, vol. 1).
#[must_use]
pub fn median_error(sigma: f64, n: usize) -> f64 {
    1.2533 * sigma / (n.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_does_not_hang_on_how_a_period_was_rounded() {
        for period_s in [0.049_999_999_999_999_99, 0.05, 0.050_000_000_000_000_1, 0.049_999, 0.050_001] {
            assert_eq!(half_window(0.5, period_s), 5, "{period_s}");
        }
        assert_eq!([half_window(0.5, 0.051), half_window(0.0, 0.05), half_window(0.5, f64::INFINITY)], [4, 0, 0]);
        assert_eq!([half_window(0.5, 0.0), half_window(0.5, f64::NAN)], [0, 0]);
    }
}
