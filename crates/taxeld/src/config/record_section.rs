//! `[record]`: recordings of the live traffic.

use std::path::PathBuf;

use serde::Deserialize;

/// Smallest budget, in MB: less than a few files make no recording.
const BUDGET_MB_MIN: u64 = 16;

/// `[record]`; without it nothing is recorded.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordSection {
    /// The folder; made if absent.
    pub path: PathBuf,
    /// Megabytes that all recordings there may take together; the oldest go.
    #[serde(default = "two_gigabytes")]
    pub budget_mb: u64,
    /// A file that is larger is ended, in megabytes.
    #[serde(default = "sixty_four")]
    pub file_mb: u64,
    /// A file that is older is ended, in minutes.
    #[serde(default = "ten")]
    pub file_minutes: u64,
    /// With less space on the disk nothing is recorded, in megabytes.
    #[serde(default = "half_a_gigabyte")]
    pub keep_free_mb: u64,
    /// The frames of the buses, of which a replay computes everything again.
    #[serde(default = "yes")]
    pub frames: bool,
    /// The force of every patch.
    #[serde(default = "yes")]
    pub force: bool,
    /// Every taxel of every patch: ten times as much as all else.
    #[serde(default)]
    pub taxels: bool,
    /// Events.
    #[serde(default = "yes")]
    pub events: bool,
}

fn two_gigabytes() -> u64 {
    2048
}

fn sixty_four() -> u64 {
    64
}

fn ten() -> u64 {
    10
}

fn half_a_gigabyte() -> u64 {
    512
}

fn yes() -> bool {
    true
}

/// What is wrong with the section, if anything is: its key and the words.
pub fn problem(section: &RecordSection) -> Option<(&'static str, String)> {
    let RecordSection { path, budget_mb, file_mb, file_minutes, .. } = section;
    if path.as_os_str().is_empty() {
        return Some(("record.path", "record.path = \"\": expected a folder".to_owned()));
    }
    if *budget_mb < BUDGET_MB_MIN || *budget_mb > u64::MAX / 1_000_000 {
        return Some(("record.budget_mb", format!("record.budget_mb = {budget_mb}: expected {BUDGET_MB_MIN} or more")));
    }
    if *file_mb == 0 || *file_mb > budget_mb / 2 {
        let most = budget_mb / 2;
        return Some((
            "record.file_mb",
            format!("record.file_mb = {file_mb}: expected 1 to {most}, half of record.budget_mb"),
        ));
    }
    if !(1..=1440).contains(file_minutes) {
        return Some(("record.file_minutes", format!("record.file_minutes = {file_minutes}: expected 1 to 1440")));
    }
    if !(section.frames || section.force || section.taxels || section.events) {
        return Some(("record", "[record]: nothing is to be recorded: leave the section out".to_owned()));
    }
    None
}

/// The section as a line of `taxeld check`.
pub fn written(section: &RecordSection) -> String {
    let RecordSection { frames, force, taxels, events, .. } = section;
    let what = [(frames, "frames"), (force, "force"), (taxels, "taxels"), (events, "events")];
    let what: Vec<&str> = what.iter().filter(|(asked, _)| **asked).map(|(_, what)| *what).collect();
    format!(
        "recording: {} in {}, MCAP files of at most {} MB and {} min, {} MB together; {} MB of the disk are kept free",
        what.join(", "),
        section.path.display(),
        section.file_mb,
        section.file_minutes,
        section.budget_mb,
        section.keep_free_mb
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_holds_at_least_two_files() {
        let told = |text: &str| problem(&toml::from_str(&format!("path = \"r\"\n{text}")).unwrap());
        assert_eq!(told(""), None);
        for (text, key, words) in [
            ("budget_mb = 15", "record.budget_mb", "expected 16 or more"),
            ("budget_mb = 100\nfile_mb = 51", "record.file_mb", "expected 1 to 50"),
            ("file_minutes = 0", "record.file_minutes", "expected 1 to 1440"),
            ("frames = false\nforce = false\nevents = false", "record", "nothing is to be recorded"),
        ] {
            let (at, said) = told(text).unwrap();
            assert_eq!(at, key);
            assert!(said.contains(words), "{said}");
        }
    }
}
