//! Time, as data: the engine reads no clock.

use taxel_skin::Time;

/// The present, as the shell knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Now {
    /// On the run's clock; deadlines and order.
    pub time: Time,
    /// Nanoseconds since 1970, only ever a label.
    pub wall_ns: i64,
}

impl Now {
    /// The moment at which a frame was received that is being looked at now; a stamp from the future counts as now.
    #[must_use]
    pub fn at(self, time: Time) -> Self {
        let time = time.min(self.time);
        let wall_offset_ns = self.wall_ns.saturating_sub(self.time.as_nanos());
        Self { time, wall_ns: time.as_nanos().saturating_add(wall_offset_ns) }
    }
}
