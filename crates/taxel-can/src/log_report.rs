//! What became of the lines of a log.

use taxel_wire::candump::LogError;

use crate::log_times::LogTimes;

/// Bad lines that are kept with their reason; all are counted.
const BAD_LINES_TOLD: usize = 5;
/// Of fewer frames no more than their order is known.
const SUSPICIOUS_FRAMES: u64 = 16;
/// Interfaces that are kept by name.
const INTERFACES_TOLD: usize = 8;

/// A line that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadLine {
    /// Its number, from 1.
    pub line: u64,
    /// Why.
    pub fault: LogError,
}

/// What became of the lines. Those that are neither frames nor bad are blank, or words about others.
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
    /// What could not be read to its end, and why.
    pub faults: Vec<String>,
    /// Frames that the recorder lost, by its own words.
    pub lost: u64,
    /// The line in which it said so first; of a recording that has no lines, 0.
    pub lost_line: u64,
    /// Lines refused.
    pub bad: u64,
    /// The first few of them.
    pub first_bad: Vec<BadLine>,
    /// The times of the frames handed out.
    pub times: LogTimes,
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
        if self.bad > 0 && self.frames + self.other_interface == 0 {
            lines.push(
                "  another program's log is converted by `pip install python-can && can_logconvert IN OUT.log`".into(),
            );
        }
        if self.lost > 0 {
            let place =
                if self.lost_line > 0 { format!(", the first before line {}", self.lost_line) } else { String::new() };
            lines.push(format!("the recorder lost {} frames{place}", self.lost));
        }
        lines.extend(self.time_fault());
        lines.extend(self.times.step_words());
        lines
    }

    /// Why the times tell nothing of pace and order, so that neither a gauge nor a board can be judged by them.
    #[must_use]
    pub fn time_fault(&self) -> Option<String> {
        (self.frames >= SUSPICIOUS_FRAMES).then(|| self.times.fault(self.frames))?
    }

    /// Why there is no frame of `interface`, or of any interface without one: its first line that is no frame, or the interfaces
    /// that there are.
    #[must_use]
    pub fn frame_fault(&self, interface: Option<&str>) -> Option<String> {
        if self.frames > self.errors {
            return None;
        }
        Some(match self.first_bad.first() {
            _ if self.errors > 0 => {
                let of = interface.map(|interface| format!(" of {interface}")).unwrap_or_default();
                format!("there is no frame{of} in it, only error frames: {}", self.errors)
            }
            _ if self.other_interface > 0 => format!(
                "none of its {} frames is of {}: they are of {}. Name one: `--interface {}` of scan, or `interface` of the bus in \
                 the configuration",
                self.other_interface,
                interface.unwrap_or_default(),
                self.interfaces.join(", "),
                self.interfaces.first().map_or("can0", String::as_str)
            ),
            Some(bad) => {
                format!("not one of its {} lines is a frame: line {}: {}", self.lines, bad.line, bad.fault)
            }
            None => "there is no frame in it".to_owned(),
        })
    }

    #[cold]
    pub(crate) fn refuse(&mut self, fault: LogError) {
        self.bad += 1;
        if self.first_bad.len() < BAD_LINES_TOLD {
            self.first_bad.push(BadLine { line: self.lines, fault });
        }
    }

    /// Notes an interface of which there are frames.
    pub fn note_interface(&mut self, name: &str) {
        if self.interfaces.len() < INTERFACES_TOLD && !self.interfaces.iter().any(|known| known == name) {
            self.interfaces.push(name.to_owned());
        }
    }
}
