//! Which deadlines there are: arithmetic alone.

use std::time::Duration;

/// Deadlines at multiples of a period after an origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Deadlines {
    /// The first that has not been told.
    next: Duration,
    period: Duration,
}

impl Deadlines {
    /// From the first after `now` on. `origin` is not after `now`; a period of zero is taken for a nanosecond.
    pub(crate) fn after(now: Duration, origin: Duration, period: Duration) -> Self {
        let period = period.max(Duration::from_nanos(1));
        let since_last_ns = now.saturating_sub(origin).as_nanos() % period.as_nanos();
        // Both are nanoseconds of a few hundred years at most.
        let since_last = Duration::from_nanos(u64::try_from(since_last_ns).unwrap_or_default());
        Self { next: now + (period - since_last), period }
    }

    pub(crate) const fn next(&self) -> Duration {
        self.next
    }

    pub(crate) const fn period(&self) -> Duration {
        self.period
    }

    /// That `count` more have passed: when the first of them was, and how many passed after it.
    pub(crate) fn pass(&mut self, count: u64) -> Option<(Duration, u64)> {
        let missed = count.checked_sub(1)?;
        let due = self.next;
        let ns = self.period.as_nanos() * u128::from(count);
        self.next += Duration::from_nanos(u64::try_from(ns).unwrap_or(u64::MAX));
        Some((due, missed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ORIGIN: Duration = Duration::from_nanos(1_234_567_891);

    fn period(rate_hz: f64) -> Duration {
        Duration::from_secs_f64(1.0 / rate_hz)
    }

    /// The rates from 1 Hz to 1 kHz, met by whoever is up to `late` periods late with each tick: how many ticks came and
    /// how many were missed in ten seconds.
    fn ten_seconds(rate_hz: f64, late: &[f64]) -> (u64, u64) {
        let (begun, period) = (ORIGIN + Duration::from_micros(12_345), period(rate_hz));
        let mut deadlines = Deadlines::after(begun, ORIGIN, period);
        let (mut told, mut ticks, mut missed) = (begun, 0, 0);
        for late in late.iter().cycle() {
            let now = deadlines.next() + period.mul_f64(*late);
            let passed = (now - deadlines.next()).as_nanos() / period.as_nanos() + 1; // the kernel's count
            let (due, more) = deadlines.pass(u64::try_from(passed).unwrap()).unwrap();
            assert_eq!((due - ORIGIN).as_nanos() % period.as_nanos(), 0, "{rate_hz} Hz: {due:?} is not on the grid");
            assert!(told < due && due <= now && now < deadlines.next(), "{rate_hz} Hz: {due:?} at {now:?}");
            (told, ticks, missed) = (due, ticks + 1, missed + more);
            if now - begun >= Duration::from_secs(10) {
                break;
            }
        }
        (ticks, missed)
    }

    proptest! {
        #[test]
        fn a_rate_is_met_in_the_mean_however_late_its_ticks_are(
            rate_hz in 1.0..1_000.0, late in prop::collection::vec(0.0..0.999, 1..50)
        ) {
            let (ticks, missed) = ten_seconds(rate_hz, &late);
            let wanted = 10.0 * rate_hz;
            prop_assert!((ticks as f64 - wanted).abs() <= 2.0, "{ticks} ticks, {wanted} wanted");
            prop_assert_eq!(missed, 0);
        }

        #[test]
        fn what_is_later_than_a_period_is_missed_and_counted(
            rate_hz in 1.0..1_000.0, late in prop::collection::vec(0.0..9.0, 1..50)
        ) {
            let (ticks, missed) = ten_seconds(rate_hz, &late);
            prop_assert!(((ticks + missed) as f64 - 10.0 * rate_hz).abs() <= 11.0, "{ticks} ticks, {missed} missed");
        }
    }

    #[test]
    fn equal_rates_tick_together_whenever_they_began() {
        for rate_hz in [1.0, 3.0, 50.0, 333.0, 1_000.0] {
            let period = period(rate_hz);
            let early = Deadlines::after(ORIGIN + period.mul_f64(7.2), ORIGIN, period);
            let late = Deadlines::after(ORIGIN + period.mul_f64(7.8), ORIGIN, period);
            assert_eq!(early, late, "{rate_hz} Hz");
            assert_eq!(early.next(), ORIGIN + 8 * period, "{rate_hz} Hz");
            assert_eq!(
                Deadlines::after(ORIGIN + 8 * period, ORIGIN, period).next(),
                ORIGIN + 9 * period,
                "{rate_hz} Hz"
            );
        }
    }

    #[test]
    fn nothing_has_passed_when_the_kernel_says_so() {
        let mut deadlines = Deadlines::after(ORIGIN, ORIGIN, Duration::from_secs(1));
        let before = deadlines.clone();
        assert_eq!(deadlines.pass(0), None);
        assert_eq!(deadlines, before);
    }
}
