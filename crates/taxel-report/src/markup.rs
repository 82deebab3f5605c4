//! Text in HTML and SVG.

/// `text` with everything replaced that has a meaning in HTML or SVG, also within quotes.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Other control characters are not allowed in XML at all.
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A figure for people: three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { value.to_string() };
    }
    // Rounding first, so that 9.999 becomes 10.0 and not 10.00.
    let power = format!("{size:.2e}").split_once('e').and_then(|(_, power)| power.parse::<i32>().ok()).unwrap_or(0);
    match power {
        -3..=2 => format!("{value:.*}", (2 - power) as usize),
        3..=5 => format!("{value:.0}"),
        _ => format!("{value:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_with_a_meaning_is_left() {
        assert_eq!(escape("a<b & \"c\" > 'd'\u{1}"), "a&lt;b &amp; &quot;c&quot; &gt; &#39;d&#39;\u{fffd}");
    }

    #[test]
    fn three_digits_of_any_size() {
        let cases = [
            (0.0, "0"),
            (9.999, "10.0"),
            (-1.0, "-1.00"),
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
