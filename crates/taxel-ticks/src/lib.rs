//! Ticks at a fixed rate, up to thousands a second, each at its own deadline and exact to some ten microseconds.
//!
//! 1. Deadlines are multiples of the period and not "so long after the last one", so that no lateness adds up: the rate is
//!    met in the mean.
//! 2. The kernel's own timer counts them, in nanoseconds. The runtime's timers count whole milliseconds and are rounded
//!    up when it sleeps: at 1 kHz each tick came 0.08 ms later than the one before, until two came at once.
//! 3. What was missed is told and not made up for: the value of a tick that is long past is an old one.

mod deadlines;

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::LazyLock;
use std::time::Duration;

use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use nix::time::clock_gettime;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use crate::deadlines::Deadlines;

/// Where all deadlines of the process are counted from. So equal rates tick together, and one wake-up of a runtime does for
/// all of them.
static ORIGIN: LazyLock<Duration> = LazyLock::new(|| now().unwrap_or_default());

/// Ticks, without end.
#[derive(Debug)]
pub struct Ticks {
    timer: AsyncFd<OwnedFd>,
    deadlines: Deadlines,
}

/// One or more deadlines that have passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// The time of `CLOCK_BOOTTIME` at which it was due, or the first of those that passed since the last tick.
    pub due: Duration,
    /// How long ago that was.
    pub late: Duration,
    /// How many more deadlines have passed since.
    pub missed: u64,
}

impl Ticks {
    /// Ticks with this period, of at least a nanosecond. The first comes within one period, together with those of
    /// others of the same period. Needs a tokio runtime with I/O.
    ///
    /// # Errors
    /// If the system has no timer left.
    pub fn every(period: Duration) -> io::Result<Self> {
        let deadlines = Deadlines::after(now()?, *ORIGIN, period);
        // Its successor is `unsafe`, for the sake of descriptors that change under it. A descriptor that is owned does not.
        #[expect(deprecated, reason = "safe for an `OwnedFd`")]
        let timer = AsyncFd::with_interest(OwnedFd::from(timer(&deadlines)?), Interest::READABLE)?;
        Ok(Self { timer, deadlines })
    }

    /// Waits for the next deadline. Nothing is lost if this is dropped before.
    ///
    /// # Errors
    /// If the system takes the timer away.
    pub async fn tick(&mut self) -> io::Result<Tick> {
        loop {
            let mut ready = self.timer.readable().await?;
            let passed = passed(ready.get_inner())?;
            ready.clear_ready();
            if let Some((due, missed)) = self.deadlines.pass(passed) {
                return Ok(Tick { due, late: now()?.saturating_sub(due), missed });
            }
        }
    }
}

/// A timer that goes off at each of them.
fn timer(deadlines: &Deadlines) -> io::Result<TimerFd> {
    let timer = TimerFd::new(ClockId::CLOCK_BOOTTIME, TimerFlags::TFD_NONBLOCK | TimerFlags::TFD_CLOEXEC)?;
    let (first, period) = (TimeSpec::from(deadlines.next()), TimeSpec::from(deadlines.period()));
    timer.set(Expiration::IntervalDelayed(first, period), TimerSetTimeFlags::TFD_TIMER_ABSTIME)?;
    Ok(timer)
}

/// How many deadlines have passed since it was asked last.
fn passed(timer: impl AsFd) -> io::Result<u64> {
    let mut count = [0; size_of::<u64>()];
    match nix::unistd::read(timer, &mut count) {
        Ok(_) => Ok(u64::from_ne_bytes(count)),
        Err(nix::errno::Errno::EAGAIN | nix::errno::Errno::EINTR) => Ok(0),
        Err(error) => Err(error.into()),
    }
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
    fn the_kernel_has_each_deadline_to_the_nanosecond() {
        // So long a period that no deadline passes while this looks; so odd ones that no whole millisecond hides in them.
        let hour = Duration::from_secs(3_600);
        for odd in (0..50).map(|n| n * Duration::from_nanos(123_457)) {
            let deadlines = Deadlines::after(now().unwrap(), now().unwrap() - hour / 2 - odd, hour);
            let timer = timer(&deadlines).unwrap();
            let before = now().unwrap();
            let set = timer.get().unwrap();
            let after = now().unwrap();
            let Some(Expiration::IntervalDelayed(left, period)) = set else { panic!("{set:?}") };
            let expected = deadlines.next() - after..=deadlines.next() - before;
            assert!(expected.contains(&left.into()), "{left:?} left, expected {expected:?}");
            assert_eq!(Duration::from(period), hour);
        }
    }

    #[tokio::test]
    async fn each_deadline_is_told_once_and_not_before_it_has_passed() {
        let mut ticks = Ticks::every(PERIOD).unwrap();
        let mut due = ticks.deadlines.next();
        for _ in 0..50 {
            let tick = ticks.tick().await.unwrap();
            assert!(tick.due == due && tick.due <= now().unwrap(), "{tick:?}, expected {due:?}");
            due += PERIOD * (1 + u32::try_from(tick.missed).unwrap());
        }
    }

    #[tokio::test]
    async fn what_passed_while_nobody_looked_is_one_tick() {
        let mut ticks = Ticks::every(PERIOD).unwrap();
        let due = ticks.deadlines.next();
        while now().unwrap() < due + 3 * PERIOD {
            std::hint::spin_loop();
        }
        let tick = ticks.tick().await.unwrap();
        assert!(tick.due == due && tick.missed >= 3 && tick.late >= 3 * PERIOD, "{tick:?}");
        let next = ticks.tick().await.unwrap();
        assert_eq!(next.due, due + PERIOD * (1 + u32::try_from(tick.missed).unwrap()), "{tick:?}, {next:?}");
    }

    #[tokio::test]
    async fn a_wait_that_is_given_up_loses_no_tick() {
        let mut ticks = Ticks::every(PERIOD).unwrap();
        let mut due = ticks.deadlines.next();
        for _ in 0..20 {
            tokio::select! {
                biased;
                tick = ticks.tick() => due += PERIOD * (1 + u32::try_from(tick.unwrap().missed).unwrap()),
                () = tokio::task::yield_now() => {}
            }
        }
        assert_eq!(ticks.tick().await.unwrap().due, due);
    }
}
