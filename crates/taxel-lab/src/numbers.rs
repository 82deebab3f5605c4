//! From many measured values to the few figures of a page.

/// The value below which this share of the others lies, one that occurred; NaN of none. What is not finite counts as
/// greatest.
pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (share * sorted.len() as f64).ceil().max(1.0) as usize - 1;
    sorted.get(place).copied().unwrap_or(f64::NAN)
}

/// Least, median and greatest of the finite values.
pub(crate) fn spread(mut values: Vec<f64>) -> Option<(f64, f64, f64)> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    Some((*values.first()?, values[values.len() / 2], *values.last()?))
}

/// NaN of none.
pub(crate) fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// NaN of none.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    sum / n
}

/// A figure for people: three significant digits; counts as they are.
pub(crate) fn three_digits(value: f64) -> String {
    digits(value, 3)
}

/// A figure with so many significant digits, 1 or more; counts as they are.
pub(crate) fn digits(value: f64, significant: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    if value.fract() == 0.0 && value.abs() < 1e6 {
        return format!("{value}");
    }
    let behind = significant.saturating_sub(1);
    // Rounding first, so that 9.999 becomes 10.0 and not 10.00.
    let size = format!("{:.behind$e}", value.abs());
    let power = size.split_once('e').and_then(|(_, power)| power.parse::<i32>().ok()).unwrap_or(0);
    match power {
        -3..=5 => format!("{value:.*}", usize::try_from(behind as i32 - power).unwrap_or(0)),
        _ => format!("{value:.behind$e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occurred() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!([0.05, 0.5, 0.99, 0.999].map(|share| quantile(&values, share)), [5.0, 50.0, 99.0, 100.0]);
        assert_eq!(quantile(&[7.0], 0.0), 7.0);
        assert!(median(&[]).is_nan() && mean(std::iter::empty()).is_nan());
    }

    #[test]
    fn three_digits_of_any_size() {
        let cases = [
            (0.0, "0"),
            (9.999, "10.0"),
            (-1.0, "-1"),
            (2500.0, "2500"),
            (1.001, "1.00"),
            (0.001_234_5, "0.00123"),
            (0.000_999_9, "0.00100"),
            (123_456.0, "123456"),
            (1.5e-11, "1.50e-11"),
            (2.5e6, "2.50e6"),
            (f64::NAN, "NaN"),
        ];
        for (value, want) in cases {
            assert_eq!(three_digits(value), want);
        }
    }
}
