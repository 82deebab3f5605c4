//! What a start finds lost, noted beside the database before anything of it is changed: putting it right takes the traces
//! away, and a stop in between must not make the loss untold. A start that has told it and acted on it removes the note.

use std::io;
use std::path::Path;

use crate::error::Quarantined;
use crate::{beside, wal_check};

/// How findings name the write-ahead log.
pub(crate) const LOG: &str = "the write-ahead log";

/// A note has a line or two.
const NOTE_BYTES_MAX: u64 = 64 << 10;

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
    beside::replace(path, &beside::loss_note(path), findings.iter().map(line).collect::<String>().as_bytes())
}

/// What earlier starts found lost and did not live to tell; nothing as a rule.
pub(crate) fn noted(path: &Path) -> Vec<Quarantined> {
    let text = match beside::read_small(&beside::loss_note(path), NOTE_BYTES_MAX) {
        Ok(Some(bytes)) => String::from_utf8_lossy(&bytes).into_owned(),
        Ok(None) => return Vec::new(),
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

/// All that a store has lost by what lies beside it: what was noted, and what its log lost. What was noted of the log is that
/// already: since then nobody was told that anything is on disk.
pub(crate) fn found(path: &Path) -> io::Result<Vec<Quarantined>> {
    let mut found = noted(path);
    if found.iter().all(|known| known.what != LOG) {
        found.extend(wal_check::problem(path)?.map(|reason| Quarantined::lost(LOG, reason)));
    }
    Ok(found)
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
    use std::fs;
    use std::process::Command;

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
        let name = beside::loss_note(&path);
        let unreadable = |reason: &str| [Quarantined::lost("the note of what an earlier start found lost", reason)];
        fs::create_dir(&name).unwrap();
        assert_eq!(noted(&path), unreadable("it is no regular file"));
        fs::remove_dir(&name).unwrap();
        assert!(Command::new("mkfifo").arg(&name).status().unwrap().success());
        assert_eq!(noted(&path), unreadable("it is no regular file"));
        fs::remove_file(&name).unwrap();
        std::os::unix::fs::symlink("/dev/zero", &name).unwrap();
        assert_eq!(noted(&path), unreadable("it is no regular file"));
        fs::remove_file(&name).unwrap();
        fs::File::create(&name).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(noted(&path), unreadable("it has 1099511627776 bytes, expected at most 65536"));
    }
}
