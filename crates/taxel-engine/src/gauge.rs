//! The recent past of the differential pressure: interpolated at a scan's own time, and its rate of rise.

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{Kilopascal, Time};

/// How far back readings are kept. A scan waits for the reading after it, at most one gauge period.
const KEPT: Duration = Duration::from_secs(2);

/// Most readings kept: 2 s of a gauge that sends every millisecond. Older ones go first.
const READINGS_MAX: usize = 2_000;

/// The stretch over which the rate is taken.
const RATE_SPAN: Duration = Duration::from_secs(1);

/// What the gauge said lately, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct GaugeHistory {
    readings: VecDeque<(Time, f64)>,
    /// Readings that were not later than the one before; counted and left out.
    out_of_order: u64,
}

/// What is known of the pressure at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PressureAt {
    /// Interpolated between the readings before and after.
    Known(Kilopascal),
    /// The reading after it has not come yet.
    NotYet,
    /// No two readings close enough around it.
    Unknown,
}

impl GaugeHistory {
    /// Takes one reading; one that is not later than its predecessor is counted and left out.
    pub fn push(&mut self, time: Time, pressure: Kilopascal) {
        if self.readings.back().is_some_and(|&(last, _)| time <= last) {
            self.out_of_order += 1;
            return;
        }
        while self.readings.len() >= READINGS_MAX
            || self.readings.front().is_some_and(|&(first, _)| time.since(first) > KEPT)
        {
            self.readings.pop_front();
        }
        self.readings.push_back((time, pressure.0));
    }

    /// Readings left out because they came out of order.
    #[must_use]
    pub const fn out_of_order(&self) -> u64 {
        self.out_of_order
    }

    /// The newest reading.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, Kilopascal)> {
        self.readings.back().map(|&(time, kpa)| (time, Kilopascal(kpa)))
    }

    /// The pressure at `time`, linear between its neighbours, which may be `timeout` apart at the most.
    #[must_use]
    pub fn at(&self, time: Time, timeout: Duration) -> PressureAt {
        let after = self.readings.partition_point(|&(t, _)| t < time);
        let Some(&(t1, p1)) = self.readings.get(after) else {
            return PressureAt::NotYet;
        };
        if t1 == time {
            return PressureAt::Known(Kilopascal(p1));
        }
        let Some(&(t0, p0)) = after.checked_sub(1).and_then(|before| self.readings.get(before)) else {
            return PressureAt::Unknown;
        };
        if t1.since(t0) > timeout {
            return PressureAt::Unknown;
        }
        let share = time.seconds_since(t0) / t1.seconds_since(t0);
        PressureAt::Known(Kilopascal(p0 + share * (p1 - p0)))
    }

    /// Slope of the least-squares line through the readings of the second that ends at `time`, in kPa/s.
    /// `None` with fewer than three readings there.
    #[must_use]
    pub fn rate_kpa_per_s(&self, time: Time) -> Option<f64> {
        let recent = || {
            let from = time - RATE_SPAN;
            self.readings.iter().rev().skip_while(move |r| r.0 > time).take_while(move |r| r.0 >= from)
        };
        let (mut n, mut sum_t, mut sum_p) = (0.0, 0.0, 0.0);
        for &(t, p) in recent() {
            n += 1.0;
            sum_t += t.seconds_since(time);
            sum_p += p;
        }
        if n < 3.0 {
            return None;
        }
        let (mean_t, mean_p) = (sum_t / n, sum_p / n);
        let (mut stt, mut stp) = (0.0, 0.0);
        for &(t, p) in recent() {
            let dt = t.seconds_since(time) - mean_t;
            stt += dt * dt;
            stp += dt * (p - mean_p);
        }
        (stt > 0.0).then(|| stp / stt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    const TIMEOUT: Duration = Duration::from_millis(500);

    #[test]
    fn pressure_is_linear_between_readings_and_nowhere_else() {
        let mut gauge = GaugeHistory::default();
        gauge.push(ms(0), Kilopascal(10.0));
        gauge.push(ms(100), Kilopascal(20.0));
        assert_eq!(gauge.at(ms(25), TIMEOUT), PressureAt::Known(Kilopascal(12.5)));
        assert_eq!(gauge.at(ms(100), TIMEOUT), PressureAt::Known(Kilopascal(20.0)));
        assert_eq!(gauge.at(ms(101), TIMEOUT), PressureAt::NotYet);
        assert_eq!(gauge.at(ms(-1), TIMEOUT), PressureAt::Unknown);
        gauge.push(ms(700), Kilopascal(30.0));
        assert_eq!(gauge.at(ms(300), TIMEOUT), PressureAt::Unknown, "the gauge was silent for longer than the limit");
    }

    #[test]
    fn rate_is_the_slope_of_the_last_second() {
        let mut gauge = GaugeHistory::default();
        for i in 0..300 {
            gauge.push(ms(i * 10), Kilopascal(if i < 100 { 5.0 } else { 5.0 + 0.02 * (i - 100) as f64 }));
        }
        assert!((gauge.rate_kpa_per_s(ms(2_990)).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(gauge.rate_kpa_per_s(ms(10_000)), None);
    }

    #[test]
    fn readings_out_of_order_are_counted_and_left_out() {
        let mut gauge = GaugeHistory::default();
        gauge.push(ms(10), Kilopascal(1.0));
        gauge.push(ms(10), Kilopascal(9.0));
        gauge.push(ms(5), Kilopascal(9.0));
        assert_eq!((gauge.out_of_order(), gauge.newest()), (2, Some((ms(10), Kilopascal(1.0)))));
    }

    #[test]
    fn memory_is_bounded() {
        let mut gauge = GaugeHistory::default();
        for i in 0..100_000 {
            gauge.push(Time::from_nanos(i), Kilopascal(0.0));
        }
        assert_eq!(gauge.readings.len(), READINGS_MAX);
    }
}
