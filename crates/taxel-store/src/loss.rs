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
    let line = |finding: &Quarantined| {
        let words = |text: &str| text.replace(['\n', '\r', THEN], " ");
        format!("{}{THEN}{}\n", words(&finding.what), words(&finding.reason))
    };
    let mut findings = noted(path);
    if !findings.contains(finding) {
        findings.push(finding.clone());
    }
    beside::replace(&beside::loss_note(path), findings.iter().map(line).collect::<String>().as_bytes())
}

/// What earlier starts found lost and did not live to tell; nothing as a rule.
pub(crate) fn noted(path: &Path) -> Vec<Quarantined> {
    let text = match fs::read(beside::loss_note(path)) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Vec::new(),
        Err(error) => return vec![Quarantined::new("the note of what an earlier start found lost", error)],
    };
    let finding = |line: &str| {
        let (what, reason) = line.split_once(THEN).unwrap_or(("the store", line));
        Quarantined::new(what, reason)
    };
    let findings: Vec<_> = text.lines().map(finding).collect();
    // Of a note without a line nothing is known but that something was lost.
    if findings.is_empty() {
        vec![Quarantined::new("the store", "an earlier start found something lost")]
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
