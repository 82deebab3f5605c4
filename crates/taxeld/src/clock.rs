//! The run's clock: monotonic time live, the log's own time in a replay.

use std::sync::{Arc, OnceLock};
use std::time::Instant;

use taxel_can::ClockReading;
use taxel_engine::Now;
use taxel_skin::Time;

/// Where "now" comes from. Clones tell the same time.
#[derive(Clone, Debug)]
pub enum RunClock {
    /// The kernel's monotonic clock, on which frames are stamped.
    Live,
    /// A log's time, `speed` times as fast as it was written, from its first frame on.
    Log {
        /// Factor.
        speed: f64,
        /// First frame's time and when it was read.
        anchor: Arc<OnceLock<(Time, Instant)>>,
    },
}

impl RunClock {
    /// A log's clock that stands still until [`RunClock::start`].
    pub fn of_log(speed: f64) -> Self {
        Self::Log { speed, anchor: Arc::default() }
    }

    /// The first frame of a log was read.
    pub fn start(&self, first: Time) {
        if let Self::Log { anchor, .. } = self {
            anchor.get_or_init(|| (first, Instant::now()));
        }
    }

    /// The present.
    pub fn now(&self) -> Now {
        match self {
            Self::Live => {
                let now = ClockReading::now();
                Now { time: now.time, wall_ns: now.wall_ns }
            }
            Self::Log { speed, anchor } => {
                let time =
                    anchor.get().map_or(Time::default(), |&(first, read)| first + read.elapsed().mul_f64(*speed));
                Now { time, wall_ns: time.as_nanos() } // a log's stamps are seconds since 1970
            }
        }
    }
}
