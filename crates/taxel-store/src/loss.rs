//! What a start finds lost, noted beside the database before anything of it is changed: putting it right takes the traces
//! away, and a stop in between must not make the loss untold. A start that has told it and acted on it removes the note.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use crate::beside;
use crate::error::Quarantined;

/// Between what is lost and why.
const THEN: char = '\t';

/// Adds a finding to the note.
///
/// # Errors
/// If it cannot be written: then nothing may be changed.
pub(crate) fn note(path: &Path, finding: &Quarantined) -> io::Result<()> {
    let words = |text: &str| text.replace(['\n', '\r', THEN], " "); // as it is read again
    let finding = Quarantined::lost(words(&finding.what), words(&finding.reason));
    let line = |finding: &Quarantined| format!("{}{THEN}{}\n", finding.what, finding.reason);
    let mut findings = noted(path);
    if !findings.contains(&finding) {
        findings.push(finding);
    }
    beside::replace(&beside::loss_note(path), findings.iter().map(line).collect::<String>().as_bytes())
}

/// What earlier starts found lost and did not live to tell; nothing as a rule.
pub(crate) fn noted(path: &Path) -> Vec<Quarantined> {
    let text = match fs::read(beside::loss_note(path)) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Vec::new(),
        Err(error) => return vec![Quarantined::lost("the note of what an earlier start found lost", error)],
    };
    let finding = |line: &str| {
        let (what, reason) = line.split_once(THEN).unwrap_or(("the store", line));
        Quarantined::lost(what, reason)
    };
    let findings: Vec<_> = text.lines().map(finding).collect();
    // Of a note without a line nothing is known but that something was lost.
    if findings.is_empty() {
        vec![Quarantined::lost("the store", "an earlier start found something lost")]
    } else {
        findings
    }
}

/// Removes the note.
pub(crate) fn forget(path: &Path) {
    let note = beside::loss_note(path);
    if let Err(error) = beside::remove(&note) {
        // The next start tells the loss once more, and doubts zeros that somebody may have vouched for since.
        tracing::warn!(note = %note.display(), %error, "the note of what was lost could not be removed");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_is_noted_once_each_until_the_note_is_removed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        let [log, rows] = [("the log", "it is\tmissing"), ("two rows", "one\nand\ranother")]
            .map(|(what, reason)| Quarantined::lost(what, reason));
        assert_eq!(noted(&path), []);
        for finding in [&log, &rows, &log] {
            note(&path, finding).unwrap();
        }
        let lines = [Quarantined::lost("the log", "it is missing"), Quarantined::lost("two rows", "one and another")];
        assert_eq!(noted(&path), lines);
        forget(&path);
        assert_eq!(noted(&path), []);
    }

    #[test]
    fn of_a_note_that_cannot_be_read_it_is_known_that_something_was_lost() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store.db");
        fs::write(beside::loss_note(&path), "").unwrap();
        assert_eq!(noted(&path), [Quarantined::lost("the store", "an earlier start found something lost")]);
        fs::write(beside::loss_note(&path), "half a li").unwrap();
        assert_eq!(noted(&path), [Quarantined::lost("the store", "half a li")]);
        fs::remove_file(beside::loss_note(&path)).unwrap();
        fs::create_dir(beside::loss_note(&path)).unwrap();
        assert_eq!(noted(&path)[0].what, "the note of what an earlier start found lost");
    }
}
