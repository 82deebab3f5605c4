//! Numbers as the page writes them.

/// What stands where nothing was entered.
pub(crate) const NOT_STATED: &str = "not stated";
/// What stands where the data do not tell.
const NOT_DETERMINED: &str = "n/d";

/// A text that may not have been stated.
pub(crate) fn stated(text: Option<&str>) -> String {
    text.map(str::trim).filter(|text| !text.is_empty()).unwrap_or(NOT_STATED).to_owned()
}

/// A number with so many decimals and its unit.
pub(crate) fn with_unit(value: Option<f64>, decimals: usize, unit: &str) -> String {
    value.map_or_else(|| NOT_STATED.to_owned(), |value| format!("{value:.decimals$} {unit}"))
}

/// A number with so many decimals; without a sign if it rounds to 0.
pub(crate) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        _ => text,
    }
}

/// The same of a number that may not be known.
pub(crate) fn known(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| NOT_DETERMINED.to_owned(), |value| number(value, decimals))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_said_and_nothing_rounds_to_minus_zero() {
        assert_eq!([number(-0.004, 2), number(-0.006, 2), number(1.0, 0)], ["0.00", "-0.01", "1"]);
        assert_eq!([known(None, 2), known(Some(0.126), 2)], ["n/d", "0.13"]);
        assert_eq!([stated(None), stated(Some(" ")), stated(Some("lab"))], ["not stated", "not stated", "lab"]);
        assert_eq!([with_unit(None, 1, "kPa"), with_unit(Some(21.0), 1, "C")], ["not stated", "21.0 C"]);
    }
}
