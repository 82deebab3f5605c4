//! The kernel's clocks, and how a receive time on one becomes a time on the other.
//!
//! The kernel stamps frames with its wall clock, which steps when somebody sets it. Deadlines and order need the
//! monotonic clock. Both are read at each batch, and a frame's age (wall now - wall stamp) is taken from the monotonic
//! now. A step between stamp and reading falsifies at most the batch that it hits, and never by more than
//! [`AGE_MAX`].

use nix::time::{ClockId, clock_gettime};
use std::time::Duration;
use taxel_skin::Time;

/// Frames do not wait longer than this in the kernel: its buffer holds half a second of a full bus.
pub const AGE_MAX: Duration = Duration::from_secs(1);

/// The monotonic clock: the run's time of a live bus.
#[must_use]
pub fn monotonic() -> Time {
    nanos(ClockId::CLOCK_MONOTONIC)
}

/// The wall clock as time since 1970.
#[must_use]
pub fn realtime() -> Time {
    nanos(ClockId::CLOCK_REALTIME)
}

fn nanos(clock: ClockId) -> Time {
    // Both clocks always exist on Linux.
    let now = clock_gettime(clock).map(Duration::from).unwrap_or_default();
    Time::from_nanos(i64::try_from(now.as_nanos()).unwrap_or(i64::MAX))
}

/// Both clocks at one moment.
#[derive(Clone, Copy, Debug)]
pub struct ClockPair {
    /// Monotonic.
    pub monotonic: Time,
    /// Wall.
    pub realtime: Time,
}

impl ClockPair {
    /// Reads both.
    #[must_use]
    pub fn now() -> Self {
        Self { monotonic: monotonic(), realtime: realtime() }
    }

    /// The monotonic time of a frame that the kernel stamped at `stamp` on the wall clock.
    #[must_use]
    pub fn to_monotonic(self, stamp: Time) -> Time {
        self.monotonic - self.realtime.since(stamp).min(AGE_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_keeps_its_age_and_a_clock_step_is_bounded() {
        let pair = ClockPair { monotonic: Time::from_seconds(100.0), realtime: Time::from_seconds(5_000.0) };
        assert_eq!(pair.to_monotonic(Time::from_seconds(4_999.75)), Time::from_seconds(99.75));
        assert_eq!(pair.to_monotonic(Time::from_seconds(6_000.0)), Time::from_seconds(100.0), "from the future: now");
        assert_eq!(pair.to_monotonic(Time::from_seconds(0.0)), Time::from_seconds(99.0), "stepped by an hour");
    }
}
