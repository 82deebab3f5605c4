//! Parameters and numbers as the robot's files write them.

/// The value of a parameter, without the quotes that some have.
pub fn value<'a>(params: &'a [(String, String)], name: &str) -> Option<&'a str> {
    let (_, value) = params.iter().find(|(n, _)| n.eq_ignore_ascii_case(name))?;
    Some(value.trim().trim_matches('"').trim())
}

/// A number, decimal or hexadecimal.
pub fn number(text: &str) -> Option<i64> {
    let text = text.trim();
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(hex) => i64::from_str_radix(hex, 16).ok(),
        None => text.parse().ok(),
    }
}

/// The numbers of a list; brackets and commas are tolerated.
pub fn numbers(text: &str) -> Vec<i64> {
    text.split(|c: char| c.is_whitespace() || "(),;".contains(c)).filter_map(number).collect()
}
