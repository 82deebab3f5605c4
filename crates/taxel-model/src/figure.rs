//! A number as people read it.

/// Written out, or with an exponent where it is far from 1.
#[must_use]
pub fn figure(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-3..1e6).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_is_short_and_is_read_again_as_the_same() {
        for value in [0.0, -0.0, 5.0, -0.1, 1e-3, 9.999e-4, 999_999.5, 1e6, f64::MAX, -f64::MIN_POSITIVE, 5e-324] {
            let shown = figure(value);
            assert!(shown.len() <= 24, "{shown}");
            assert_eq!(shown.parse::<f64>().unwrap().to_bits(), value.to_bits(), "{shown}");
        }
        assert_eq!([5.0, 0.001, 5e-4, 1e308, f64::INFINITY].map(figure), ["5", "0.001", "5e-4", "1e308", "inf"]);
    }
}
