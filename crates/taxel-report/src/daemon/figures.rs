//! From many measured values to the few figures of a page.

/// The value below which this share of the sorted `values` lies; NaN of none.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let place = (share * values.len() as f64).ceil().max(1.0) as usize - 1;
    values.get(place.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

/// The values, ascending.
pub(super) fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// `number` in words that fit a sentence: three significant digits, no exponent for the sizes that occur here.
pub(super) fn figure(number: f64) -> String {
    let decimals = (2.0 - number.abs().max(1e-3).log10().floor()).clamp(0.0, 5.0);
    format!("{number:.*}", decimals as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occurred() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!((quantile(&values, 0.5), quantile(&values, 0.99), quantile(&values, 0.999)), (50.0, 99.0, 100.0));
        assert_eq!(quantile(&[7.0], 0.0), 7.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn figures_have_three_digits() {
        assert_eq!((figure(0.01234), figure(1.2345), figure(123.45), figure(12345.6)).0, "0.0123");
        assert_eq!((figure(1.2345), figure(123.45), figure(12345.6)), ("1.23".into(), "123".into(), "12346".into()));
        assert_eq!(figure(f64::NAN), "NaN");
    }
}
