//! The recent past of the differential pressure: interpolated at a scan's own time, and its trend.

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{BusIndex, Kilopascal, Time};
use taxel_wire::signal::SignalSpec;

use crate::statistics::median;

/// How far back readings are kept. A scan waits a second before it enters a session, and the trend at its time looks
/// back another second.
const KEPT: Duration = Duration::from_secs(4);

/// Most readings kept: 4 s of a gauge that sends every millisecond. Older ones go first.
const READINGS_MAX: usize = 4_000;

/// The stretch over which the trend is taken.
const TREND_SPAN: Duration = Duration::from_secs(1);

/// Where the differential pressure comes from.
#[derive(Clone, Debug)]
pub struct Gauge {
    /// The bus it sits on.
    pub bus: BusIndex,
    /// Its frame.
    pub signal: SignalSpec,
}

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

    /// Where the pressure is and where it goes, from the readings of the second that ends at `time`.
    ///
    /// Both come from the medians of the second's halves, which a spike of the gauge does not move. `None` with fewer
    /// than two readings in a half.
    #[must_use]
    pub fn trend(&self, time: Time) -> Option<Trend> {
        let (from, middle) = (time - TREND_SPAN, time - TREND_SPAN / 2);
        let half = |after: Time, until: Time| {
            let readings = self.readings.iter().filter(|r| r.0 > after && r.0 <= until);
            let (times, pressures): (Vec<f64>, Vec<f64>) = readings.map(|&(t, p)| (t.seconds_since(time), p)).unzip();
            let mean_s = times.iter().sum::<f64>() / times.len() as f64;
            if times.len() >= 2 { Some((mean_s, median(pressures)?)) } else { None }
        };
        let ((t0, p0), (t1, p1)) = half(from, middle).zip(half(middle, time))?;
        let rate_kpa_per_s = (p1 - p0) / (t1 - t0);
        Some(Trend { rate_kpa_per_s, level_kpa: p1 - rate_kpa_per_s * t1 })
    }
}

/// Where the pressure is and where it goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trend {
    /// Rate of rise in kPa/s.
    pub rate_kpa_per_s: f64,
    /// What the gauge should read now, in kPa.
    pub level_kpa: f64,
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
    fn trend_is_that_of_the_last_second() {
        let mut gauge = GaugeHistory::default();
        for i in 0..300 {
            gauge.push(ms(i * 10), Kilopascal(if i < 100 { 5.0 } else { 5.0 + 0.02 * (i - 100) as f64 }));
        }
        let trend = gauge.trend(ms(2_990)).unwrap();
        assert!((trend.rate_kpa_per_s - 2.0).abs() < 1e-9 && (trend.level_kpa - 8.98).abs() < 0.02, "{trend:?}");
        assert_eq!(gauge.trend(ms(10_000)), None);
    }

    #[test]
    fn a_spike_moves_neither_rate_nor_level() {
        let mut gauge = GaugeHistory::default();
        for i in 0..100 {
            gauge.push(ms(i * 20), Kilopascal(if i == 97 { 60.0 } else { 0.02 * i as f64 }));
        }
        let trend = gauge.trend(ms(1_980)).unwrap();
        assert!((trend.rate_kpa_per_s - 1.0).abs() < 0.05 && (trend.level_kpa - 1.98).abs() < 0.05, "{trend:?}");
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
