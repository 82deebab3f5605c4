//! What became of the lines of a log.

use taxel_skin::Time;
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
    /// Empty lines, comments (`#` first), the words of `candump -e` for an error frame (a tab first), and what `candump -d`
    /// says of lost frames.
    pub blank: u64,
    /// What could not be read to its end, and why.
    pub faults: Vec<String>,
    /// Frames that the recorder lost, by its own words.
    pub lost: u64,
    /// The lines in which it says so: the first, and how many.
    pub lost_lines: Option<(u64, u64)>,
    /// What is known of the times of the frames handed out.
    pub times: Times,
    /// Lines refused.
    pub bad: u64,
    /// The first few of them.
    pub first_bad: Vec<BadLine>,
    /// Frames handed out whose time was before that of an earlier one, by at most a second. They keep their time.
    pub backwards: u64,
    /// Where times were earlier by more than that, or later by more than a day, and go on from there.
    pub clock: ClockSteps,
}

/// The times of a log, as they are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Times {
    /// The first.
    first: Option<Time>,
    /// There are others.
    differ: bool,
    /// Some are between two seconds.
    fractions: bool,
}

impl LogReport {
    /// What a user should know of the lines, a line each; empty if all of them are frames whose time goes on.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut lines: Vec<_> =
            self.faults.iter().map(|fault| format!("{fault}; everything before it was read")).collect();
        if self.bad > 0 {
            lines.push(format!("{} of {} lines are no frame:", self.bad, self.lines));
            lines.extend(self.first_bad.iter().map(|bad| format!("  line {}: {}", bad.line, bad.fault)));
        }
        lines.extend(self.lost_words());
        lines.extend(self.time_fault());
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

    fn lost_words(&self) -> Option<String> {
        let (line, count) = self.lost_lines?;
        let more = if count > 1 { format!(" and at {} more places", count - 1) } else { String::new() };
        Some(format!("the recorder lost {} frames, before line {line}{more}", self.lost))
    }

    /// Why the times tell nothing of pace and order, so that neither a gauge nor a board can be judged by them.
    #[must_use]
    pub fn time_fault(&self) -> Option<String> {
        let Times { first, differ, fractions } = self.times;
        let first = first.filter(|_| self.frames >= SUSPICIOUS_FRAMES && !(differ && fractions))?;
        let frames = self.frames;
        Some(if differ {
            format!(
                "all times of its {frames} frames are whole seconds: record with `candump -l`, which writes microseconds"
            )
        } else {
            let seconds = first.as_seconds();
            format!("all {frames} frames share one time ({seconds} s): record without -H")
        })
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

    /// Notes that frames were lost before the present line; gives how many.
    pub fn note_lost(&mut self, frames: u64) -> u64 {
        self.lost = self.lost.saturating_add(frames);
        let (first, count) = self.lost_lines.unwrap_or((self.lines, 0));
        self.lost_lines = Some((first, count + 1));
        frames
    }

    pub(crate) fn note_time(&mut self, time: Time) {
        let first = *self.times.first.get_or_insert(time);
        self.times.differ |= time != first;
        self.times.fractions |= time.as_nanos() % 1_000_000_000 != 0;
    }

    /// Notes an interface of which there are frames.
    pub fn note_interface(&mut self, name: &str) {
        if self.interfaces.len() < INTERFACES_TOLD && !self.interfaces.iter().any(|known| known == name) {
            self.interfaces.push(name.to_owned());
        }
    }
}
