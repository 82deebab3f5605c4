//! The recent past of the differential pressure: interpolated at a scan's own time, and its trend.

#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::time::Duration;
use taxel_skin::{BusIndex, Kilopascal, Time};
use taxel_wire::bits::ByteOrder;
use taxel_wire::signal::{PressureMeaning, SignalSpec};

use crate::statistics::median;

/// How far back readings are kept. A scan waits a second before it enters a session, and the trend at its time looks
/// back another second.
const KEPT: Duration = Duration::from_secs(4);

/// Most readings kept: 4 s of a gauge that sends every millisecond. Older ones go first.
const READINGS_MAX: usize = 4_000;

/// The stretch over which the trend is taken.
const TREND_SPAN: Duration = Duration::from_secs(1);

/// While a gauge rests so much of its readings may be spikes.
const SPIKES_MAX_SHARE: f64 = 0.1;

/// A pressure that falls faster is let go.
const FALLING_KPA_PER_S: f64 = 0.5;

/// Of its greatest reading of the last second a pressure that holds keeps so much.
const HELD_SHARE: f64 = 0.9;

/// A newest reading that is older than so many usual distances of two says nothing of now.
const USUAL_AGES_MAX: u32 = 3;

/// A single step further than a pressure goes by so much is the gauge's own, kPa: several times what gauges err by.
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
    /// Whether a program pushes its readings: then no other frames come over its bus.
    pub pushed: bool,
    /// Whether the ambient pressure of its signal is a guess, and what it reads of the vented bag before a ramp is right.
    pub takes_ambient: bool,
}

impl Gauge {
    /// A gauge that sends its frames over a bus, and knows the ambient pressure if it needs it.
    #[must_use]
    pub const fn new(bus: BusIndex, signal: SignalSpec) -> Self {
        Self { bus, signal, pushed: false, takes_ambient: false }
    }

    /// What its differences in pressure hang on, in words. A constant is in none: each ramp counts from what it read at rest.
    #[must_use]
    pub fn words(&self) -> String {
        let SignalSpec { id, start_bit, length_bits, byte_order, signed, scale, unit, meaning, .. } = self.signal;
        let signed = if signed { "signed" } else { "unsigned" };
        let end = if byte_order == ByteOrder::Little { "little" } else { "big" };
        let kind = match meaning {
            PressureMeaning::Differential => "differential",
            PressureMeaning::AbsoluteBag { .. } => "absolute",
        };
        let step_kpa = unit.to_kilopascal(scale);
        format!(
            "{id}, {length_bits} bits from {start_bit} on, {end} end first, {signed}, {step_kpa} kPa a step, {kind}"
        )
    }
}

/// What the gauge said lately, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct GaugeHistory {
    readings: VecDeque<(Time, f64)>,
    /// What is taken off every reading, kPa: of a gauge that reads the bag's own pressure, how far the ambient pressure was guessed
    /// wrong.
    taken_off_kpa: f64,
    changes: Changes,
    /// Single steps, the newest last.
    jumps: VecDeque<Jump>,
}

/// A step of a gauge that stands alone.
#[derive(Clone, Copy, Debug)]
struct Jump {
    /// When it was read before.
    time: Time,
    kpa: f64,
    /// Since when it had read the same, in seconds: what a pressure had time to go.
    seconds: f64,
}

impl Jump {
    /// Whether it is further than a pressure that goes at most so fast.
    fn is_of_gauge(&self, steepest_kpa_per_s: f64) -> bool {
        self.kpa.abs() - steepest_kpa_per_s * self.seconds > JUMP_MIN_KPA
    }
}

/// The steps of a gauge, without the readings between in which it repeated itself.
#[derive(Clone, Debug, Default)]
struct Changes {
    /// When it changed last, to what, and when it was read last.
    last: Option<(Time, f64, Time)>,
    /// The step before the newest, and the newest.
    before: Option<f64>,
    newest: Option<Jump>,
}

impl Changes {
    /// Takes a reading; the step before it, if that stands alone. What is no number is no reading: a jump behind it would be
    /// none.
    fn push(&mut self, time: Time, kpa: f64) -> Option<Jump> {
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
        let jump = self.newest.filter(|newest| newest.is_of_gauge(0.0) && single(newest.kpa));
        self.before = self.newest.map(|newest| newest.kpa);
        self.newest = Some(Jump { time: read, kpa: step, seconds: time.seconds_since(since) });
        jump
    }
}

/// How still a gauge has to be while its own zero is taken.
#[derive(Clone, Copy, Debug)]
pub struct RestLimits {
    /// Between the medians of the second's halves, kPa.
    pub drift_kpa: f64,
    /// Of nine readings of ten and the newest from the median, kPa.
    pub spike_kpa: f64,
    /// The newest reading is no older.
    pub timeout: Duration,
}

/// What a gauge reads while a skin rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GaugeAtRest {
    /// Too few readings to say.
    NotHeard,
    /// It does not stand still: its least and its greatest reading, kPa.
    Moves(f64, f64),
    /// It stands still.
    Still {
        /// Where.
        kpa: Kilopascal,
        /// When it read that last.
        newest: Time,
    },
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
    /// Takes one reading; one that is not later than its predecessor is left out.
    pub fn push(&mut self, time: Time, pressure: Kilopascal) {
        if self.readings.back().is_some_and(|&(last, _)| time <= last) {
            return;
        }
        let pressure = Kilopascal(pressure.0 - self.taken_off_kpa);
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

    /// What it reads as `kpa` is 0 kPa from now on, and was.
    pub fn count_from(&mut self, kpa: f64) {
        self.taken_off_kpa += kpa;
        self.readings.iter_mut().for_each(|reading| reading.1 -= kpa);
        self.changes.last.iter_mut().for_each(|last| last.1 -= kpa);
    }

    /// By how much the gauge jumped between `from` and `until`, up and down together, kPa, where a pressure goes at most so fast:
    /// its readings differ from the pressure by that much more at the end than at the beginning. A jump is known with the next
    /// reading.
    #[must_use]
    pub fn jumped(&self, from: Time, until: Time, steepest_kpa_per_s: f64) -> f64 {
        let within = self.jumps.iter().filter(|jump| jump.time >= from && jump.time < until);
        within.filter(|jump| jump.is_of_gauge(steepest_kpa_per_s)).map(|jump| jump.kpa).sum()
    }

    /// By how much readings between `from` and `until` were further from the one before than a pressure goes meanwhile, up and down
    /// together, kPa. A gauge that repeats itself while nothing happens has been right all the time, so its jump shows here, and
    /// not in [`Self::jumped`].
    #[must_use]
    pub fn stepped(&self, from: Time, until: Time, steepest_kpa_per_s: f64) -> f64 {
        let within = self.readings.iter().filter(|&&(time, kpa)| time >= from && time <= until && kpa.is_finite());
        let pairs = within.clone().zip(within.skip(1));
        let steps = pairs.map(|(a, b)| (b.1 - a.1, steepest_kpa_per_s * b.0.seconds_since(a.0)));
        steps.filter(|(step, pressure)| step.abs() - pressure > JUMP_MIN_KPA).map(|(step, _)| step).sum()
    }

    /// The newest reading.
    #[must_use]
    pub fn newest(&self) -> Option<(Time, Kilopascal)> {
        self.readings.back().map(|&(time, kpa)| (time, Kilopascal(kpa)))
    }

    /// That its newest reading is older than `timeout`, or that there is none, in words.
    #[must_use]
    pub fn silence(&self, now: Time, timeout: Duration) -> Option<String> {
        let Some((time, _)) = self.newest() else {
            let why =
                "no pressure has been heard: is the gauge on, and is its CAN identifier the one in [patch.gauge]?";
            return Some(why.to_owned());
        };
        let age = now.since(time);
        (age > timeout).then(|| format!("the last pressure came {:.1} s ago", age.as_secs_f64()))
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

    /// What it reads while a skin rests, from the second that ends at `time`. The medians of its halves may differ by `drift_kpa`,
    /// and single readings before the newest by any amount; more of them by `spike_kpa` from the median of all.
    #[must_use]
    pub fn at_rest(&self, time: Time, limits: RestLimits) -> GaugeAtRest {
        let since = time - TREND_SPAN;
        let (times, recent): (Vec<Time>, Vec<f64>) =
            self.readings.iter().filter(|r| r.0 > since && r.0 <= time).copied().unzip();
        let fresh = self.readings.back().is_some_and(|&(newest, _)| time.since(newest) <= limits.timeout);
        let known = self.trend(time).zip(median(recent.clone())).filter(|_| fresh);
        let Some((trend, kpa)) = known else { return GaugeAtRest::NotHeard };
        // What is no number is within nothing.
        let within = |kpa: f64, limit: f64| kpa.abs() <= limit;
        let away: Vec<bool> = recent.iter().map(|reading| !within(reading - kpa, limits.spike_kpa)).collect();
        let many = away.iter().filter(|away| **away).count() as f64 > SPIKES_MAX_SHARE * away.len() as f64;
        let (least, most) = recent.iter().fold((kpa, kpa), |(least, most), r| (least.min(*r), most.max(*r)));
        // The halves are half a span apart.
        let drifts = !within(trend.rate_kpa_per_s * 0.5 * TREND_SPAN.as_secs_f64(), limits.drift_kpa);
        // The newest reading that is away may be the first of a jump.
        match times.last().zip(away.last()) {
            Some((&newest, false)) if !(many || drifts) => GaugeAtRest::Still { kpa: Kilopascal(kpa), newest },
            _ => GaugeAtRest::Moves(least, most),
        }
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
impl GaugeHistory {
    /// One that has read nothing but 0 kPa every 10 ms in the second until `time`.
    pub(crate) fn at_rest_until(time: Time) -> Self {
        let mut gauge = Self::default();
        (0..100).rev().for_each(|n| gauge.push(time - Duration::from_millis(10 * n), Kilopascal(0.0)));
        gauge
    }
}
