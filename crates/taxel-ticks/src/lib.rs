//! Ticks at a fixed rate, up to thousands a second, each at its own deadline and exact to some ten microseconds.
//!
//! 1. Deadlines are multiples of the period and not "so long after the last one", so that no lateness adds up: the rate is
//!    met in the mean.
//! 2. The kernel's own timer counts them, in nanoseconds. The runtime's timers count whole milliseconds and are rounded
//!    up when it sleeps: at 1 kHz each tick came 0.08 ms later than the one before, until two came at once.
//! 3. What was missed is not made up for: the value of a tick that is long past is an old one.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::LazyLock;
use std::time::Duration;

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use nix::time::clock_gettime;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// Where all deadlines of the process are counted from. So equal rates tick together, and one wake-up of a runtime does for
/// all of them.
static ORIGIN: LazyLock<Duration> = LazyLock::new(|| now().unwrap_or_default());

/// Ticks, without end.
#[derive(Debug)]
pub struct Ticks(AsyncFd<OwnedFd>);

impl Ticks {
    /// Ticks with this period, of at least a nanosecond. The first comes within one period, together with those of
    /// others of the same period. Needs a tokio runtime with I/O.
    ///
    /// # Errors
    /// If the system has no timer left.
    pub fn every(period: Duration) -> io::Result<Self> {
        let period = period.max(Duration::from_nanos(1));
        let timer = TimerFd::new(ClockId::CLOCK_BOOTTIME, TimerFlags::TFD_NONBLOCK | TimerFlags::TFD_CLOEXEC)?;
        let deadlines = Expiration::IntervalDelayed(first(*ORIGIN, now()?, period).into(), TimeSpec::from(period));
        timer.set(deadlines, TimerSetTimeFlags::TFD_TIMER_ABSTIME)?;
        // Its successor is `unsafe`, for the sake of descriptors that change under it. A descriptor that is owned does not.
        #[expect(deprecated, reason = "safe for an `OwnedFd`")]
        let timer = AsyncFd::with_interest(OwnedFd::from(timer), Interest::READABLE)?;
        Ok(Self(timer))
    }

    /// Waits for the next deadline; if some have passed since the last tick, it is one tick. Nothing is lost if this is
    /// dropped before.
    ///
    /// # Errors
    /// If the system takes the timer away.
    pub async fn tick(&mut self) -> io::Result<()> {
        loop {
            let mut ready = self.0.readable().await?;
            let passed = nix::unistd::read(ready.get_inner(), &mut [0; size_of::<u64>()]);
            ready.clear_ready();
            match passed {
                Ok(_) => return Ok(()),
                Err(Errno::EAGAIN | Errno::EINTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
}

/// The first multiple of a period after `origin` that is after `now`.
fn first(origin: Duration, now: Duration, period: Duration) -> Duration {
    let since_last_ns = now.saturating_sub(origin).as_nanos() % period.as_nanos();
    // Less than a period, which is nanoseconds of a few hundred years at most.
    now + period - Duration::from_nanos(u64::try_from(since_last_ns).unwrap_or_default())
}

/// The time of `CLOCK_BOOTTIME`.
fn now() -> io::Result<Duration> {
    Ok(clock_gettime(nix::time::ClockId::CLOCK_BOOTTIME)?.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    #[test]
    fn equal_rates_tick_together_whenever_they_began() {
        let origin = Duration::from_nanos(1_234_567_891);
        for rate_hz in [1.0, 3.0, 50.0, 333.0, 1_000.0] {
            let period = Duration::from_secs_f64(1.0 / rate_hz);
            for late in [7.2, 7.8] {
                assert_eq!(first(origin, origin + period.mul_f64(late), period), origin + 8 * period, "{rate_hz} Hz");
            }
            assert_eq!(first(origin, origin + 8 * period, period), origin + 9 * period, "{rate_hz} Hz");
        }
    }

    #[tokio::test]
    async fn no_tick_comes_before_its_deadline_and_what_passed_meanwhile_is_one() {
        let begun = now().unwrap();
        let mut ticks = Ticks::every(PERIOD).unwrap();
        for ticked in 0..50 {
            ticks.tick().await.unwrap();
            assert!(now().unwrap() >= begun + PERIOD * ticked, "{ticked}");
        }
        let begun = now().unwrap();
        while now().unwrap() < begun + 5 * PERIOD {
            std::hint::spin_loop();
        }
        ticks.tick().await.unwrap();
        assert!(futures_are_pending(&mut ticks).await, "they are one");
    }

    /// Whether no tick is there yet; one may have come if the machine was busy.
    async fn futures_are_pending(ticks: &mut Ticks) -> bool {
        let next = first(*ORIGIN, now().unwrap(), PERIOD);
        tokio::select! {
            biased;
            _ = ticks.tick() => now().unwrap() >= next,
            () = tokio::task::yield_now() => true,
        }
    }
}
