//! The run's clock: CLOCK_BOOTTIME live, the log's own time in a replay.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use taxel_can::ClockReading;
use taxel_engine::Now;
use taxel_skin::Time;
use tokio::time::Instant;

/// Where "now" comes from. Clones tell the same time.
#[derive(Clone, Debug)]
pub enum RunClock {
    /// `CLOCK_BOOTTIME`, on which frames are stamped.
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

    /// A clock of the process, by which a task is judged to run or to hang: live the same, in a replay one that does not
    /// run at the log's speed.
    pub fn of_process(&self) -> Arc<dyn Fn() -> Time + Send + Sync> {
        match self {
            Self::Live => Arc::new(|| ClockReading::now().time),
            Self::Log { .. } => {
                let begun = Instant::now();
                Arc::new(move || Time::default() + begun.elapsed())
            }
        }
    }

    /// For how long to set a timer so that so much time passes on this clock.
    pub fn timer(&self, span: Duration) -> Duration {
        match self {
            Self::Live => span,
            Self::Log { speed, .. } => Duration::try_from_secs_f64(span.as_secs_f64() / speed).unwrap_or(Duration::MAX),
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
