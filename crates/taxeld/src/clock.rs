//! The run's clock.

use std::sync::Arc;

use taxel_can::ClockReading;
use taxel_engine::Now;

/// Where "now" comes from. Clones tell the same time.
pub type RunClock = Arc<dyn Fn() -> Now + Send + Sync>;

/// `CLOCK_BOOTTIME`, on which frames are stamped.
pub fn boottime() -> RunClock {
    Arc::new(|| {
        let ClockReading { time, wall_ns } = ClockReading::now();
        Now { time, wall_ns }
    })
}
