//! The two clocks: `CLOCK_BOOTTIME` orders, the wall clock labels.

use nix::time::{ClockId, clock_gettime};
use taxel_skin::Time;

/// Both clocks, read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockReading {
    /// `CLOCK_BOOTTIME`: the clock of a live run. It never steps and goes on while the machine is suspended, so that what
    /// was received before is simply old.
    pub time: Time,
    /// `CLOCK_REALTIME` in nanoseconds since 1970: only ever a label, because it may be stepped.
    pub wall_ns: i64,
}

impl ClockReading {
    /// The present.
    #[must_use]
    pub fn now() -> Self {
        Self { time: Time::from_nanos(nanos(ClockId::CLOCK_BOOTTIME)), wall_ns: nanos(ClockId::CLOCK_REALTIME) }
    }

    /// What to add to a time of the run's clock, in ns, to get its label since 1970, as the wall clock is set now.
    #[must_use]
    pub fn wall_offset_ns(&self) -> i64 {
        self.wall_ns.saturating_sub(self.time.as_nanos())
    }

    /// The run's time of an event that the kernel stamped with its wall clock.
    ///
    /// The age by the wall clock is taken from the present of the run's clock. If the wall clock was stepped in
    /// between, the age is wrong by that step: a step back would put the event into the future, so it counts as now;
    /// a step forward would make it too old, so `floor`, a time that the event cannot precede, bounds it.
    #[must_use]
    pub(crate) fn time_of(&self, stamp_wall_ns: i64, floor: Time) -> Time {
        let age_ns = self.wall_ns.saturating_sub(stamp_wall_ns).max(0);
        Time::from_nanos(self.time.as_nanos().saturating_sub(age_ns)).max(floor)
    }
}

fn nanos(clock: ClockId) -> i64 {
    // None of these clocks can fail on Linux; the origin would be seen as an absurd age.
    clock_gettime(clock).map_or(0, |at| at.tv_sec().saturating_mul(1_000_000_000).saturating_add(at.tv_nsec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: ClockReading = ClockReading { time: Time::from_nanos(5_000), wall_ns: 1_000_000 };

    #[test]
    fn age_by_the_wall_clock_counts_back_from_the_monotonic_present() {
        assert_eq!(NOW.time_of(1_000_000 - 300, Time::default()), Time::from_nanos(4_700));
    }

    #[test]
    fn a_step_of_the_wall_clock_moves_no_frame_beyond_its_bounds() {
        let floor = Time::from_nanos(4_000);
        assert_eq!(NOW.time_of(2_000_000, floor), NOW.time, "stepped back: not in the future");
        assert_eq!(NOW.time_of(0, floor), floor, "stepped forward: not before what was read before");
    }
}
