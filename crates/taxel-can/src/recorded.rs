//! Frames that somebody recorded, wherever they come from.

use std::io;

use taxel_wire::TimedFrame;
use thiserror::Error;

use crate::log_report::LogReport;

/// Reading or unpacking a log failed. All complete lines before were handed out; of a damaged gzip those lack that were
/// unpacked together with the damage, at most a block.
#[derive(Debug, Error)]
#[error("{name}: after line {line}: {error}")]
pub struct LogFault {
    /// The log.
    pub name: String,
    /// The last complete line, from 1.
    pub line: u64,
    /// The system's or the decoder's answer.
    pub error: io::Error,
}

/// The frames of one bus as they were recorded, from first to last: of a candump log, or of a recording.
pub trait RecordedFrames: Send {
    /// Appends up to `max` frames (of every kind, error frames too) in their order; fewer where the recorder lost some behind
    /// them ([`RecordedFrames::take_lost`]). `false`: there are no more.
    ///
    /// # Errors
    /// [`LogFault`] if it cannot be read on; `frames` holds what was read before.
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> Result<bool, LogFault>;

    /// How many frames the recorder lost between what was handed out last and what comes, by its own words; told once.
    fn take_lost(&mut self) -> u64 {
        0
    }

    /// What became of everything so far.
    fn report(&self) -> &LogReport;
}
