//! A machine that has slept. The clock of a live run stands still meanwhile, so that everything looks as fresh as before.

use std::time::Duration;

/// Sleeps that are shorter than this count as none: the two clocks are not read at once.
const SLEEP_MIN: Duration = Duration::from_millis(100);

/// Looks for sleep.
pub struct SleepWatch {
    /// For how long the machine has slept since it was started, at most a little less.
    slept: Option<fn() -> Duration>,
    known: Duration,
}

impl SleepWatch {
    /// A run on the machine's clock.
    pub fn of_machine() -> Self {
        Self::by(taxel_can::slept)
    }

    /// A run that has a clock of its own.
    pub fn never() -> Self {
        Self { slept: None, known: Duration::ZERO }
    }

    fn by(slept: fn() -> Duration) -> Self {
        Self { slept: Some(slept), known: slept() }
    }

    /// For how long the machine has slept since the last look, if it has.
    pub fn look(&mut self) -> Option<Duration> {
        let slept = (self.slept?)();
        let since = slept.saturating_sub(self.known);
        let tells = since >= SLEEP_MIN;
        if tells {
            self.known = slept; // short ones add up
        }
        tells.then_some(since)
    }

    /// For how long the machine had slept in all at the last look; `None` of a run with a clock of its own.
    pub fn known(&self) -> Option<Duration> {
        self.slept.map(|_| self.known)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::*;

    #[test]
    fn a_sleep_is_told_once_and_what_the_clocks_differ_by_is_none() {
        static SLEPT_MS: AtomicU64 = AtomicU64::new(5_000);
        let mut watch = SleepWatch::by(|| Duration::from_millis(SLEPT_MS.load(Ordering::Relaxed)));
        let mut look_at = |slept_ms| {
            SLEPT_MS.store(slept_ms, Ordering::Relaxed);
            watch.look().map(|slept| slept.as_millis())
        };
        assert_eq!(look_at(5_000), None, "before the daemon was started");
        assert_eq!(look_at(3_605_000), Some(3_600_000));
        assert_eq!(look_at(3_605_000), None);
        // Read a little too early, and in time again.
        assert_eq!((look_at(3_604_700), look_at(3_605_000)), (None, None));
        assert_eq!((watch.known(), SleepWatch::never().known()), (Some(Duration::from_secs(3_605)), None));
    }
}
