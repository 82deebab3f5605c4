//! A moment of this machine, by a clock that goes on while it sleeps.
//!
//! A force from before a sleep is old when the machine wakes up, and so is what came from another machine meanwhile and
//! waited in the network's buffers. [`std::time::Instant`] stands still then and tells neither.

use std::ops::Add;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// It counts from the start of the machine and never steps.
#[cfg(any(target_os = "linux", target_os = "android"))]
const CLOCK: ClockId = ClockId::CLOCK_BOOTTIME;
#[cfg(not(any(target_os = "linux", target_os = "android")))]
const CLOCK: ClockId = ClockId::CLOCK_MONOTONIC;

/// A moment; those of another machine, or of before a restart of this one, are of another clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(Duration);

impl Moment {
    /// Now.
    ///
    /// # Panics
    /// On a system without that clock, which Linux has had since 2.6.39.
    #[must_use]
    #[expect(
        clippy::expect_used,
        reason = "without a clock no age can be told, and none is better than one that is too small"
    )]
    pub fn now() -> Self {
        Self(Duration::from(clock_gettime(CLOCK).expect("the system has this clock")))
    }

    /// How long ago that was; zero for a moment that is to come.
    #[must_use]
    pub fn elapsed(self) -> Duration {
        Self::now().since(self)
    }

    /// How much later this is than `earlier`; zero if it is not.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Duration {
        self.0.saturating_sub(earlier.0)
    }
}

impl Add<Duration> for Moment {
    type Output = Self;

    fn add(self, later: Duration) -> Self {
        Self(self.0.saturating_add(later))
    }
}
