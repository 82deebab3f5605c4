//! A node that uses the identifiers of a board.

use std::time::Duration;
use taxel_skin::Time;
use taxel_wire::Frame;

/// A scan that goes out again and again.
#[derive(Clone, Debug)]
pub(crate) struct ForeignNode {
    frames: Vec<Frame>,
    period: Duration,
    /// When it sends next.
    pub(crate) next: Time,
}

impl ForeignNode {
    pub(crate) const fn new(frames: Vec<Frame>, period: Duration, first: Time) -> Self {
        Self { frames, period, next: first }
    }

    /// The frames of this period; plans the next.
    pub(crate) fn scan(&mut self) -> &[Frame] {
        self.next = self.next + self.period;
        &self.frames
    }
}
