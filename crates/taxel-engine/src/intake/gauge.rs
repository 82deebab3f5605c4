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

/// The stretch over which a gauge's own zero is taken.
pub const REST_SPAN: Duration = Duration::from_secs(1);

/// A pressure that falls faster is let go.
const FALLING_KPA_PER_S: f64 = 0.5;

/// Of its greatest reading of the last second a pressure that holds keeps so much.
const HELD_SHARE: f64 = 0.9;

/// A newest reading that is older than so many usual distances of two says nothing of now.
const USUAL_AGES_MAX: u32 = 3;

/// No bag's pressure goes faster for longer than a reading, vented ones excepted, kPa/s.
const STEEPEST_KPA_PER_S: f64 = 50.0;
/// A single step further than that by so much is the gauge's own, kPa: several times what gauges err by.
const JUMP_MIN_KPA: f64 = 1.0;
/// And it is single if the steps before and after it are less than this share of it: when a bag is vented they are not.
const BESIDE_JUMP_MAX: f64 = 0.25;
/// Jumps that are kept: those of a gauge with more of them say nothing new.
const JUMPS_MAX: usize = 256;

/// A gauge that says the very same for so long, and in at least so many readings, may stand still while the pressure
/// goes on.
const RUN_MIN: Duration = Duration::from_millis(300);
const RUN_READINGS_MIN: usize = 3;

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
    changes: Changes,
    /// Steps that no pressure makes, with their times, the newest last.
    jumps: VecDeque<(Time, f64)>,
}

/// The steps of a gauge, without the readings between in which it repeated itself.
#[derive(Clone, Debug, Default)]
struct Changes {
    /// When it changed last, to what, and when it was read last.
    last: Option<(Time, f64, Time)>,
    /// The step before the newest, and the newest with its time and what of it no pressure explains.
    before: Option<f64>,
    newest: Option<(Time, f64, f64)>,
}

impl Changes {
    /// Takes a reading; the step before it, if that was a jump, with the time of the reading that it began at. What is no
    /// number is no reading: a jump behind it would be none.
    fn push(&mut self, time: Time, kpa: f64) -> Option<(Time, f64)> {
        if !kpa.is_finite() {
            return None;
        }
        let (since, from, read) = self.last.replace((time, kpa, time))?;
        let step = kpa - from;
        if step == 0.0 {
            self.last = Some((since, from, time)); // it changed then
        }
        let beside = self.before.map(|before| step.abs().max(before.abs()));
        let single = |newest: f64| beside.is_some_and(|beside| beside < BESIDE_JUMP_MAX * newest.abs());
        let jump = self.newest.filter(|&(_, newest, beyond)| beyond > JUMP_MIN_KPA && single(newest));
        let beyond = step.abs() - STEEPEST_KPA_PER_S * time.seconds_since(since);
        self.before = self.newest.map(|(_, newest, _)| newest);
        self.newest = Some((read, step, beyond));
        jump.map(|(at, newest, _)| (at, newest))
    }
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
        if let Some(jump) = self.changes.push(time, pressure.0) {
            self.jumps.push_back(jump);
            if self.jumps.len() > JUMPS_MAX {
                self.jumps.pop_front();
            }
        }
    }

    /// By how much the gauge jumped between `from` and `until`, up and down together, kPa: its readings differ from the
    /// pressure by that much more at the end than at the beginning. A jump is known with the next reading.
    #[must_use]
    pub fn jumped(&self, from: Time, until: Time) -> f64 {
        let within = self.jumps.iter().filter(|&&(time, _)| time >= from && time < until);
        within.map(|&(_, kpa)| kpa).sum()
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

    /// How many readings up to the newest one are the very same, and over how long.
    #[must_use]
    pub fn run(&self) -> (usize, Duration) {
        let Some(&(newest, kpa)) = self.readings.back() else { return (0, Duration::ZERO) };
        let same = self.readings.iter().rev().take_while(|reading| reading.1 == kpa);
        let (count, first) = same.fold((0, newest), |(count, _), reading| (count + 1, reading.0));
        (count, newest.since(first))
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

    /// By how much the pressure at `time` may be wrong because the gauge repeated itself, in kPa: by the step that it made
    /// afterwards, or, while it still repeats itself, by what the pressure would have done at the rate before. A gauge of
    /// coarse steps repeats itself, too, and then makes one of its steps.
    #[must_use]
    pub fn stuck_by(&self, time: Time) -> f64 {
        let until = self.readings.partition_point(|&(t, _)| t <= time);
        let Some(at) = until.checked_sub(1) else { return 0.0 };
        let kpa = self.readings[at].1;
        let same = |&&(_, other): &&(Time, f64)| other == kpa;
        let first = at - self.readings.range(..at).rev().take_while(same).count();
        let last = at + self.readings.range(at + 1..).take_while(same).count();
        let (begin, end) = (self.readings[first].0, self.readings[last].0);
        if last - first + 1 < RUN_READINGS_MIN || end.since(begin) < RUN_MIN {
            return 0.0;
        }
        match self.readings.get(last + 1) {
            Some(&(_, next)) => (next - kpa).abs(),
            None => self.trend(begin).map_or(0.0, |trend| trend.rate_kpa_per_s.abs() * end.seconds_since(begin)),
        }
    }

    /// Whether the pressure has not begun to fall at `time`, as far as anybody can tell: its trend does not, the newest
    /// reading is no older than three usual ones and not a tenth below the greatest of the last second. The trend alone
    /// tells a fast fall only half a second late.
    #[must_use]
    pub fn is_holding(&self, time: Time) -> bool {
        let recent = || self.readings.iter().filter(|r| r.0 > time - TREND_SPAN && r.0 <= time);
        let Some(&(newest, kpa)) = recent().next_back() else { return false };
        let usual = TREND_SPAN.div_f64(recent().count() as f64);
        let greatest = recent().map(|reading| reading.1).fold(f64::NEG_INFINITY, f64::max);
        let rises = self.trend(time).is_some_and(|trend| trend.rate_kpa_per_s >= -FALLING_KPA_PER_S);
        rises && time.since(newest) <= USUAL_AGES_MAX * usual && kpa >= HELD_SHARE * greatest
    }

    /// What it reads while a skin rests: the median of the second that ends at `time`. `None` with fewer than two readings
    /// in it.
    #[must_use]
    pub fn at_rest(&self, time: Time) -> Option<Kilopascal> {
        let since = time - REST_SPAN;
        let recent = self.readings.iter().filter(|r| r.0 > since && r.0 <= time && r.1.is_finite());
        let recent: Vec<f64> = recent.map(|reading| reading.1).collect();
        if recent.len() < 2 { None } else { median(recent).map(Kilopascal) }
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

    /// A gauge that is read every 10 ms for so many seconds.
    fn read(seconds: f64, kpa: impl Fn(f64) -> f64) -> GaugeHistory {
        let mut gauge = GaugeHistory::default();
        (0..(100.0 * seconds) as i64).for_each(|n| gauge.push(ms(10 * n), Kilopascal(kpa(0.01 * n as f64))));
        gauge
    }

    #[test]
    fn a_step_that_no_pressure_makes_is_a_jump_until_the_gauge_is_back() {
        let off = |t: f64| if (1.0..2.5).contains(&t) { 3.0 } else { 0.0 };
        let gauge = read(4.0, |t| 4.0 * t + off(t));
        assert!((gauge.jumped(ms(0), ms(1500)) - 3.0).abs() < 0.1, "{:?}", gauge.jumps);
        assert!(gauge.jumped(ms(0), ms(4000)).abs() < 0.1 && gauge.jumped(ms(1500), ms(2400)) == 0.0);
        assert!((gauge.jumped(ms(1500), ms(4000)) + 3.0).abs() < 0.1, "it may have been wrong before");
        let hidden = read(2.0, |t| if (1.0..1.02).contains(&t) { f64::NAN } else { 4.0 * t + off(t) });
        assert!((hidden.jumped(ms(0), ms(1500)) - 3.0).abs() < 0.2, "{:?}", hidden.jumps);
    }

    #[test]
    fn what_a_pressure_does_is_no_jump() {
        let vented = |t: f64| if t < 1.0 { 70.0 } else { 70.0 * (-(t - 1.0) / 0.3).exp() };
        let stuck = |t: f64| if (1.0..3.0).contains(&t) { 5.0 } else { 5.0 * t };
        let coarse = |t: f64| (0.4 * t).floor();
        let spikes = |t: f64| t + if ((100.0 * t).round() as i64) % 37 == 0 { 9.0 } else { 0.0 };
        for (what, gauge) in [
            ("a vented bag", read(4.0, vented)),
            ("a gauge that stood still and caught up", read(4.0, stuck)),
            ("a gauge of coarse steps", read(20.0, coarse)),
            ("spikes of one reading", read(4.0, spikes)),
            ("noise", read(4.0, |t| 4.0 * t + 0.3 * (1e4 * t).sin())),
        ] {
            assert_eq!(gauge.jumped(ms(0), ms(20_000)), 0.0, "{what}: {:?}", gauge.jumps);
        }
    }

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
    fn a_pressure_that_has_begun_to_fall_or_is_not_heard_does_not_hold() {
        let mut gauge = GaugeHistory::default();
        for i in 0..200 {
            gauge.push(ms(i * 10), Kilopascal(0.5 * i as f64));
        }
        assert!(gauge.is_holding(ms(1_995)));
        assert!(!gauge.is_holding(ms(2_200)), "what it did in the last 0.2 s nobody knows");
        for i in 200..210 {
            gauge.push(ms(i * 10), Kilopascal(100.0 - 3.0 * (i - 199) as f64));
        }
        assert!(gauge.trend(ms(2_095)).unwrap().rate_kpa_per_s > 0.0, "the trend still rises");
        assert!(!gauge.is_holding(ms(2_095)));
    }

    #[test]
    fn what_a_gauge_reads_at_rest_is_the_median_of_the_last_second() {
        let gauge = read(4.0, |t| match t {
            t if t < 2.0 => 60.0,
            t if t < 3.0 => 5.8,
            t if t < 3.2 => f64::NAN,
            _ => 5.9,
        });
        assert_eq!(gauge.at_rest(ms(2_990)), Some(Kilopascal(5.8)), "spikes and what was before do not count");
        assert_eq!(gauge.at_rest(ms(3_990)), Some(Kilopascal(5.9)));
        assert_eq!((gauge.at_rest(ms(4_990)), gauge.at_rest(ms(9_000))), (None, None), "one reading, and none");
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
    fn a_gauge_that_stands_still_is_told_from_one_that_makes_coarse_steps() {
        let stands_from_1_to_2_s = |t: f64| if (1.0..2.0).contains(&t) { 4.0 } else { 4.0 * t };
        let of = |curve: &dyn Fn(f64) -> f64, until_ms: i64| {
            let mut gauge = GaugeHistory::default();
            (0..=until_ms / 20).for_each(|i| gauge.push(ms(i * 20), Kilopascal(curve(i as f64 * 0.02))));
            gauge
        };
        let over = of(&stands_from_1_to_2_s, 3_000);
        assert_eq!((over.stuck_by(ms(900)), over.stuck_by(ms(2_100))), (0.0, 0.0));
        for at in [1_000, 1_500, 1_990] {
            assert_eq!(over.stuck_by(ms(at)), 4.0, "at {at} ms");
        }
        let still = of(&stands_from_1_to_2_s, 1_900);
        assert!((still.stuck_by(ms(1_100)) - 3.6).abs() < 0.01, "{}", still.stuck_by(ms(1_100)));
        let coarse = of(&|t| (4.0 * t).floor() * 0.1, 3_000);
        assert!((coarse.stuck_by(ms(1_100)) - 0.1).abs() < 1e-9 || coarse.stuck_by(ms(1_100)) == 0.0);
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
