//! Frames that somebody recorded, wherever they come from.

use taxel_wire::TimedFrame;

use crate::log_fault::LogFault;
use crate::log_report::LogReport;

/// The frames of one bus as they were recorded, from first to last: of a candump log, or of a recording.
pub trait RecordedFrames: Send {
    /// Appends up to `max` frames (of every kind, error frames too) in their order; fewer where the recorder lost some behind
    /// them ([`RecordedFrames::take_lost`]). `false`: there are no more.
    ///
    /// # Errors
    /// [`LogFault`] if it cannot be read on; `frames` holds what was read before.
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> Result<bool, LogFault>;

    /// How many frames the recorder lost between what was handed out last and what comes, by its own words; told once.
    fn take_lost(&mut self) -> u64;

    /// What became of everything so far.
    fn report(&self) -> &LogReport;
}

impl<T: RecordedFrames + ?Sized> RecordedFrames for Box<T> {
    fn next_batch(&mut self, frames: &mut Vec<TimedFrame>, max: usize) -> Result<bool, LogFault> {
        self.as_mut().next_batch(frames, max)
    }

    fn take_lost(&mut self) -> u64 {
        self.as_mut().take_lost()
    }

    fn report(&self) -> &LogReport {
        self.as_ref().report()
    }
}
