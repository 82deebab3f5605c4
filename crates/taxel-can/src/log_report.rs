//! What became of the lines of a log.

use taxel_wire::candump::LogError;
use thiserror::Error;

use crate::log_clock::ClockSteps;

/// Longest line that is read: a frame's is at most 300 bytes. What is longer is refused as a whole.
pub(crate) const LINE_BYTES_MAX: usize = 4096;
/// Bad lines that are kept with their reason; all are counted.
const BAD_LINES_TOLD: usize = 5;
/// Of fewer frames no more than their order is known.
const SUSPICIOUS_FRAMES: u64 = 16;
/// Interfaces that are kept by name.
const INTERFACES_TOLD: usize = 8;

/// Why a line holds no frame.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum LineFault {
    /// It is not as candump writes it.
    #[error(transparent)]
    Syntax(#[from] LogError),
    /// It is too long to be a frame.
    #[error("longer than {LINE_BYTES_MAX} bytes")]
    TooLong,
}

/// A line that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadLine {
    /// Its number, from 1.
    pub line: u64,
    /// Why.
    pub fault: LineFault,
}

/// What became of the lines. `lines` is the sum of `frames`, `other_interface`, `blank` and `bad`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogReport {
    /// Lines read.
    pub lines: u64,
    /// Lines handed out as frames.
    pub frames: u64,
    /// Of these, error frames.
    pub errors: u64,
    /// Frames of interfaces not asked for.
    pub other_interface: u64,
    /// The interfaces of all these frames, in the order in which they came; at most eight.
    pub interfaces: Vec<String>,
    /// Empty lines, comments (`#` first), and the words of `candump -e` for an error frame (a tab first).
    pub blank: u64,
    /// Lines refused.
    pub bad: u64,
    /// The first few of them.
    pub first_bad: Vec<BadLine>,
    /// Frames handed out whose time was before that of an earlier one, by at most a second. They keep their time.
    pub backwards: u64,
    /// Where times were earlier by more than that, or later by more than a day, and go on from there.
    pub clock: ClockSteps,
}

impl LogReport {
    /// What a user should know of the lines, a line each; empty if all of them are frames whose time goes on.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if self.bad > 0 {
            lines.push(format!("{} of {} lines are no frame:", self.bad, self.lines));
            lines.extend(self.first_bad.iter().map(|bad| format!("  line {}: {}", bad.line, bad.fault)));
        }
        lines.extend(self.clock.words());
        if self.has_differences() {
            lines.push(format!(
                "{} of {} frames have a time before an earlier one: are these times from frame to frame, as `candump -td` \
                 writes them? Record with `candump -l` or `candump -ta`",
                self.backwards, self.frames
            ));
        }
        lines
    }

    /// Whether the times look like those from frame to frame, which go up and down.
    fn has_differences(&self) -> bool {
        self.frames >= SUSPICIOUS_FRAMES && self.backwards > self.frames / 4
    }

    #[cold]
    pub(crate) fn refuse(&mut self, fault: LineFault) {
        self.bad += 1;
        if self.first_bad.len() < BAD_LINES_TOLD {
            self.first_bad.push(BadLine { line: self.lines, fault });
        }
    }

    pub(crate) fn note_interface(&mut self, name: &str) {
        if self.interfaces.len() < INTERFACES_TOLD && !self.interfaces.iter().any(|known| known == name) {
            self.interfaces.push(name.to_owned());
        }
    }
}
