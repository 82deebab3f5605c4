//! Whether what a profile says makes sense.

pub(super) fn expect(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}

pub(super) fn within(key: &str, value: f64, least: f64, most: f64) -> Result<f64, String> {
    expect((least..=most).contains(&value), || format!("{key} = {value}: expected {least} to {most}"))?;
    Ok(value)
}
