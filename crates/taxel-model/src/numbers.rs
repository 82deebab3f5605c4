//! Sums and order statistics.

/// The mean; NaN of nothing.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    sum / n
}

/// The standard deviation.
pub(crate) fn spread(kpa: &[f64]) -> f64 {
    let middle = mean(kpa.iter().copied());
    mean(kpa.iter().map(|p| (p - middle).powi(2))).sqrt()
}

/// The value below which this share of them lies, on a straight line between neighbours; NaN of nothing.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let k = (place as usize).min(last);
    let (_, at, above) = values.select_nth_unstable_by(k, f64::total_cmp);
    let (at, next) = (*at, above.iter().copied().fold(f64::INFINITY, f64::min));
    if next.is_finite() { at + (next - at) * (place - k as f64) } else { at }
}

pub(crate) fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// Between the points `x`, ascending, on straight lines; held beyond.
pub(crate) fn interpolate(at: f64, x: &[f64], y: &[f64]) -> f64 {
    let next = x.partition_point(|x| *x <= at);
    if next == 0 {
        return y[0];
    }
    if next == x.len() {
        return y[next - 1];
    }
    let (x0, x1, y0, y1) = (x[next - 1], x[next], y[next - 1], y[next]);
    y0 + (y1 - y0) * ((at - x0) / (x1 - x0))
}

/// How many of them differ.
pub(crate) fn distinct(mut values: Vec<f64>) -> usize {
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values.len()
}
