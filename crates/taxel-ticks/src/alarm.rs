//! One time to be woken at, exact to some ten microseconds.

use std::io;
use std::os::fd::{AsFd, AsRawFd, RawFd};
use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// A timer that goes off once for each time that it is set to.
pub struct Alarm(AsyncFd<Timer>);

/// nix keeps the descriptor of its timer to itself.
struct Timer(TimerFd);

impl AsRawFd for Timer {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_fd().as_raw_fd()
    }
}

impl Alarm {
    /// An alarm that is not set. Needs a tokio runtime with I/O.
    ///
    /// # Errors
    /// If the system has no timer left.
    pub fn new() -> io::Result<Self> {
        let timer = TimerFd::new(ClockId::CLOCK_BOOTTIME, TimerFlags::TFD_NONBLOCK | TimerFlags::TFD_CLOEXEC)?;
        // Its successor is `unsafe`, for the sake of descriptors that change under it. That of a `TimerFd` does not.
        #[expect(deprecated, reason = "safe for a descriptor that is owned")]
        let timer = AsyncFd::with_interest(Timer(timer), Interest::READABLE)?;
        Ok(Self(timer))
    }

    /// Sets it to a time of `CLOCK_BOOTTIME`; what it was set to before is forgotten. A time that has passed rings at
    /// once.
    ///
    /// # Errors
    /// None on Linux for an open timer.
    pub fn set(&self, at: Duration) -> io::Result<()> {
        let at = TimeSpec::from(at.max(Duration::from_nanos(1))); // zero would mean never
        Ok(self.0.get_ref().0.set(Expiration::OneShot(at), TimerSetTimeFlags::TFD_TIMER_ABSTIME)?)
    }

    /// Waits until it rings; for ever if it is not set. A wait that is given up loses nothing: it then still rings.
    ///
    /// # Errors
    /// If the system takes the timer away.
    pub async fn rung(&self) -> io::Result<()> {
        loop {
            let mut ready = self.0.readable().await?;
            if let Ok(rung) = ready.try_io(|timer| Ok(timer.get_ref().0.wait()?)) {
                return rung;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::now;

    #[tokio::test]
    async fn it_rings_at_its_time_and_not_before_and_can_be_set_again() {
        let alarm = Alarm::new().unwrap();
        for wait in [Duration::from_micros(1_500), Duration::ZERO, Duration::from_micros(300)] {
            let at = now().unwrap() + wait;
            alarm.set(at).unwrap();
            alarm.rung().await.unwrap();
            assert!(now().unwrap() >= at);
        }
        alarm.set(Duration::ZERO).unwrap();
        alarm.rung().await.unwrap();
    }

    #[tokio::test]
    async fn what_it_was_set_to_before_does_not_ring() {
        let alarm = Alarm::new().unwrap();
        let begun = now().unwrap();
        alarm.set(begun + Duration::from_millis(1)).unwrap();
        alarm.set(begun + Duration::from_millis(5)).unwrap();
        alarm.rung().await.unwrap();
        assert!(now().unwrap() >= begun + Duration::from_millis(5));
    }
}
