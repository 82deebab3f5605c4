//! From many measured values to the few figures of a page.

use taxel_engine::statistics;

/// Least, median and greatest of the finite values.
pub(crate) fn spread(mut values: Vec<f64>) -> Option<(f64, f64, f64)> {
    values.retain(|value| value.is_finite());
    values.sort_by(f64::total_cmp);
    Some((*values.first()?, values[values.len() / 2], *values.last()?))
}

/// Of the finite values; NaN of none.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    statistics::median(values).unwrap_or(f64::NAN)
}

/// NaN of none.
pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    sum / n
}

/// A figure with so many significant digits, 1 or more; counts as they are.
pub(crate) fn digits(value: f64, significant: usize) -> String {
    if !value.is_finite() || value.fract() == 0.0 && value.abs() < 1e6 {
        return value.to_string();
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
    fn three_digits_of_any_size() {
        let cases = [
            (0.0, "0"),
            (9.999, "10.0"),
            (0.001_234_5, "0.00123"),
            (0.000_999_9, "0.00100"),
            (123_456.5, "123456"),
            (1.5e-11, "1.50e-11"),
            (2.5e6, "2.50e6"),
            (f64::NAN, "NaN"),
        ];
        for (value, want) in cases {
            assert_eq!(digits(value, 3), want);
        }
    }
}
