//! Values of the command line, and what several commands say of many values.

use taxel_engine::calibration::{SampleRefusal, SessionView};

/// So many seconds.
pub fn seconds(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| (least..=most).contains(value));
    value.ok_or_else(|| format!("expected {least} to {most} seconds"))
}

/// Refused scans by reason.
pub fn refusals<'a>(counted: impl Iterator<Item = (&'a str, u64)>) -> String {
    let counted = counted.filter(|(_, scans)| *scans > 0);
    let words: Vec<String> = counted.map(|(why, scans)| format!("{scans} {}", why.replace('_', " "))).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

/// The same of a session of an engine in this process.
pub fn refusals_of(view: &SessionView) -> String {
    refusals(SampleRefusal::ALL.into_iter().map(|reason| (reason.name(), view.refused.get(reason))))
}
