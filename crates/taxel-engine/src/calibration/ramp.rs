//! The gates of a ramp: a sample enters only while the pressure goes the way of its branch, and not too fast.
//!
//! Skin has hysteresis: a count taken while the pressure falls belongs to another curve than one taken while it rises,
//! and one taken while it moves too fast lags behind. What is on the wrong way or too fast is refused, and counted. The
//! gates are the same for both branches, seen from the other side.

use std::time::Duration;
use taxel_skin::{Kilopascal, Time};

use crate::calibration::branch::Direction;
use crate::calibration::limits::SessionLimits;
use crate::calibration::view::SampleRefusal;
use crate::intake::gauge::{GaugeHistory, PressureAt, Trend};

/// Below this rate the pressure stands still: the slope that a gauge's noise makes over one second.
const RATE_MIN_KPA_PER_S: f64 = 0.02;

/// A gauge that has jumped and is not back after so long was wrong before or is wrong now, and so is the ramp.
const JUMPED_MAX: Duration = Duration::from_secs(1);

/// The gauge over a vented bag reads hardly more, kPa. It is held against the reading itself: a gauge whose own zero lies above
/// it makes a ramp void that is vented at once, and the operator takes it again.
const VENTED_KPA: f64 = 2.0;

/// One ramp's progress.
#[derive(Clone, Debug)]
pub struct Ramp {
    direction: Direction,
    /// When the gauge last read its own zero before the ramp; `None` if it has none. A jump thereafter is one against that
    /// zero.
    gauge_zero: Option<Time>,
    /// Since when the gauge is off by a jump since then.
    off_since: Option<Time>,
    /// Furthest pressure of an accepted sample on this branch, or where the rise before it ended; kPa times the direction's sign.
    reached: f64,
    /// When the last sample was accepted, or the branch began.
    pub progress: Time,
}

/// What the gates say of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gate {
    /// It enters, at this pressure.
    Accept(Kilopascal),
    /// It does not.
    Refuse(SampleRefusal),
    /// The pressure after it is not known yet.
    Wait,
}

impl Ramp {
    /// A branch of a ramp that begins now. `gauge_zero`: when the gauge last read its own zero; without one nothing enters.
    pub const fn new(now: Time, direction: Direction, gauge_zero: Option<Time>) -> Self {
        Self { direction, gauge_zero, off_since: None, reached: f64::NEG_INFINITY, progress: now }
    }

    /// The fall of the same ramp, which begins now. It enters from where the rise ended: the skin creeps while a pressure beyond that
    /// is held.
    pub fn turned(&self, now: Time, limits: &SessionLimits) -> Self {
        let fall = Self::new(now, Direction::Falling, self.gauge_zero);
        let reached = if self.has_begun() { limits.noise_band.0 - self.reached } else { self.reached };
        Self { off_since: self.off_since, reached, ..fall }
    }

    /// Why nothing of the ramp can be trusted, if that is so: the gauge has jumped since it began, and is not back at `time`
    /// and has not been for a second. A fall to what a vented bag has is a vent and no jump: a slow gauge sees one in a single step.
    pub fn why_void(&self, time: Time, gauge: &GaugeHistory, limits: &SessionLimits) -> Option<String> {
        let since = self.gauge_zero?;
        let off = self.off_since.is_some_and(|since| time.since(since) > JUMPED_MAX);
        let vented = self.reached > limits.vented_below.0 && gauge.newest().is_some_and(|(_, kpa)| kpa.0 < VENTED_KPA);
        (off && !vented).then(|| {
            let steepest = limits.steepest_kpa_per_s;
            let (jumped, stepped) = (gauge.jumped(since, time, steepest), gauge.stepped(since, time, steepest));
            let jumped = if jumped.abs() >= stepped.abs() { jumped } else { stepped };
            format!(
                "the gauge jumped by {jumped:+.1} kPa from one reading to the next and is not back: it was wrong before or is wrong \
                 now, and so are samples of this ramp, unless the pressure itself went so far at once, faster than {steepest} kPa/s; \
                 mend the gauge, or pump more evenly, and begin a new session"
            )
        })
    }

    /// Whether the gauge reads what it would have without the jumps it has made since the ramp began.
    fn is_gauge_itself(&mut self, time: Time, gauge: &GaugeHistory, limits: &SessionLimits) -> bool {
        let itself = self.gauge_zero.is_some_and(|since| {
            let steepest = limits.steepest_kpa_per_s;
            // Before the pump runs a gauge that stands still is not stuck.
            let stepped = if self.reached == f64::NEG_INFINITY { gauge.stepped(since, time, steepest) } else { 0.0 };
            gauge.jumped(since, time, steepest).abs().max(stepped.abs()) <= limits.spike_kpa()
        });
        self.off_since = if itself { None } else { self.off_since.or(Some(time)) };
        itself
    }

    /// Judges a scan taken at `time`.
    pub fn judge(&mut self, now: Time, time: Time, gauge: &GaugeHistory, limits: &SessionLimits) -> Gate {
        let pressure = match gauge.at(time, limits.gauge_timeout) {
            PressureAt::Known(pressure) if pressure.0.is_finite() => pressure,
            PressureAt::NotYet if now.since(time) <= limits.gauge_timeout => return Gate::Wait,
            _ => return Gate::Refuse(SampleRefusal::NoPressure),
        };
        let Some(Trend { rate_kpa_per_s, level_kpa }) = gauge.trend(time) else {
            return Gate::Refuse(SampleRefusal::NoPressure);
        };
        if self.gauge_zero.is_none() {
            return Gate::Refuse(SampleRefusal::NoPressure);
        }
        let spike_kpa = limits.spike_kpa();
        if !self.is_gauge_itself(time, gauge, limits) || (pressure.0 - level_kpa).abs() > spike_kpa {
            return Gate::Refuse(SampleRefusal::GaugeSpike);
        }
        if gauge.stuck_by(time) > spike_kpa {
            return Gate::Refuse(SampleRefusal::GaugeStuck);
        }
        let sign = self.direction.sign();
        let (rate, ahead) = (sign * rate_kpa_per_s, sign * pressure.0);
        let astray = match self.direction {
            Direction::Rising => SampleRefusal::NotRising,
            Direction::Falling => SampleRefusal::NotFalling,
        };
        if rate > limits.steepest_kpa_per_s {
            return Gate::Refuse(SampleRefusal::TooFast);
        }
        if rate < RATE_MIN_KPA_PER_S || ahead < self.reached - limits.noise_band.0 {
            return Gate::Refuse(astray);
        }
        self.reached = self.reached.max(ahead);
        self.progress = time;
        Gate::Accept(pressure)
    }

    /// Whether a sample of the ramp was accepted.
    pub const fn has_begun(&self) -> bool {
        self.reached > f64::NEG_INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ms(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    /// Runs a pressure curve sampled every 10 ms and judges a scan every 50 ms; returns what was accepted.
    fn run(direction: Direction, curve: impl Fn(f64) -> f64, seconds: i64) -> Vec<f64> {
        let (mut gauge, limits) = (GaugeHistory::default(), SessionLimits::default());
        let mut ramp = Ramp::new(ms(0), direction, Some(ms(0)));
        let mut accepted = Vec::new();
        for t in (0..seconds * 1000).step_by(10) {
            gauge.push(ms(t), Kilopascal(curve(t as f64 / 1000.0)));
            if t % 50 == 0
                && let Gate::Accept(p) = ramp.judge(ms(t), ms(t), &gauge, &limits)
            {
                accepted.push(p.0);
            }
        }
        accepted
    }

    /// What is said of the scans of half a minute, each half a second later, by a gauge that is read every so many milliseconds:
    /// their times, whether they enter, and why the ramp is void then.
    fn watch(every_ms: i64, kpa: impl Fn(i64) -> f64) -> Vec<(i64, Gate, Option<String>)> {
        let (mut gauge, limits) = (GaugeHistory::default(), SessionLimits::default());
        let mut ramp = Ramp::new(ms(0), Direction::Rising, Some(ms(0)));
        let mut said = Vec::new();
        for t in (0..30_000).step_by(10) {
            if t % every_ms == 0 {
                gauge.push(ms(t), Kilopascal(kpa(t)));
            }
            if t % 50 == 0 && t >= 500 {
                let scan = t - 500;
                let gate = ramp.judge(ms(t), ms(scan), &gauge, &limits);
                said.push((scan, gate, ramp.why_void(ms(scan), &gauge, &limits)));
            }
        }
        said
    }

    /// However seldom it is read: the slower the gauge, the further a pressure may go between two of its readings.
    #[test]
    fn a_slow_gauge_that_jumps_voids_the_ramp_too() {
        for (every_ms, jump) in [(50, 3.0), (100, 3.0), (100, -3.0), (200, 5.0), (200, -5.0)] {
            let said = watch(every_ms, |t| t as f64 * 1e-3 + if t > 15_000 { jump } else { 0.0 });
            let void = said.iter().position(|(.., void)| void.is_some()).expect("a void ramp");
            let late =
                said[..=void].iter().filter(|(scan, gate, _)| *scan > 15_000 + every_ms && enters(*gate)).count();
            assert_eq!(late, 0, "{jump} kPa at {every_ms} ms");
        }
    }

    /// A bag that is vented between two readings of a slow gauge, a hand pump, a valve that opens: what goes on for several
    /// readings is a pressure, and is too fast or not.
    #[test]
    fn a_bag_that_is_vented_and_a_pressure_that_rises_in_strokes_are_no_jump() {
        let vented = |t: i64| if t < 20_000 { t as f64 * 1e-3 } else { 0.1 };
        let strokes = |t: i64| 2.0 * (t / 2_000) as f64 + 2.0 * ((t % 2_000) as f64 / 500.0).min(1.0);
        let courses: [(i64, &dyn Fn(i64) -> f64); 4] =
            [(200, &vented), (10, &strokes), (50, &strokes), (100, &strokes)];
        for (every_ms, kpa) in courses {
            for (scan, gate, void) in watch(every_ms, kpa) {
                assert_eq!(void, None, "at {scan} ms, read every {every_ms} ms");
                assert!(every_ms != 200 || scan < 20_500 || !enters(gate), "{gate:?} at {scan} ms");
            }
        }
    }

    #[test]
    fn a_gauge_that_repeated_itself_and_jumps_before_the_pump_runs_voids_the_ramp() {
        let coarse = |ms: i64| {
            ((0.0_f64.max(0.002 * (ms - 2_000) as f64) + if ms > 500 { 5.0 } else { 0.0 }) * 10.0).round() / 10.0
        };
        let (mut gauge, limits) = (GaugeHistory::default(), SessionLimits::default());
        (-300..=300).for_each(|i| gauge.push(ms(10 * i), Kilopascal(coarse(10 * i))));
        let mut ramp = Ramp::new(ms(0), Direction::Rising, Some(ms(0)));
        let said: Vec<Gate> = (10..=58).map(|i| ramp.judge(ms(5_000), ms(50 * i), &gauge, &limits)).collect();
        assert!(!said.iter().any(|gate| enters(*gate)), "{said:?}");
        let why = ramp.why_void(ms(2_900), &gauge, &limits).unwrap();
        assert!(why.starts_with("the gauge jumped by +5.0 kPa"), "{why}");
    }

    /// What is said of a scan at 3 s by a gauge that follows a curve until then, read every 10 ms, after one at 2 s.
    fn say(direction: Direction, curve: impl Fn(i64) -> f64) -> Gate {
        let (mut gauge, limits) = (GaugeHistory::default(), SessionLimits::default());
        (0..=300).for_each(|i| gauge.push(ms(10 * i), Kilopascal(curve(10 * i))));
        let mut ramp = Ramp::new(ms(0), direction, Some(ms(0)));
        ramp.judge(ms(4_000), ms(2_000), &gauge, &limits);
        ramp.judge(ms(4_000), ms(3_000), &gauge, &limits)
    }

    fn enters(gate: Gate) -> bool {
        matches!(gate, Gate::Accept(_))
    }

    #[test]
    fn a_reading_that_is_further_from_the_trend_than_noise_can_be_is_a_spike() {
        // Four noise bands of 0.3 kPa are 1.2 kPa, to both sides.
        let off = |by: f64| say(Direction::Rising, move |t| 0.002 * t as f64 + if t == 3_000 { by } else { 0.0 });
        for by in [1.1, -1.1] {
            assert!(enters(off(by)), "{by} kPa: {:?}", off(by));
        }
        for by in [1.3, -1.3, 30.0] {
            assert_eq!(off(by), Gate::Refuse(SampleRefusal::GaugeSpike), "{by} kPa");
        }
        assert_eq!(off(f64::NAN), Gate::Refuse(SampleRefusal::NoPressure), "what is no number never enters");
    }

    #[test]
    fn a_gauge_that_stood_still_for_longer_than_its_noise_explains_is_stuck() {
        // It stands from 2.6 s on while the pressure goes on: at 2.5 kPa/s by 1 kPa, at 3.5 by 1.4.
        let stands = |rate: f64| say(Direction::Rising, move |t| rate * 0.001 * t.min(2_600) as f64);
        assert_ne!(stands(2.5), Gate::Refuse(SampleRefusal::GaugeStuck));
        assert_eq!(stands(3.5), Gate::Refuse(SampleRefusal::GaugeStuck));
    }

    #[test]
    fn the_gates_are_as_wide_as_the_limits_say() {
        for (direction, sign) in [(Direction::Rising, 1.0), (Direction::Falling, -1.0)] {
            let at = |rate: f64| say(direction, move |t| 40.0 + sign * rate * 0.001 * t as f64);
            assert!(enters(at(0.025)) && enters(at(4.9)), "{direction:?}");
            let astray = if sign > 0.0 { SampleRefusal::NotRising } else { SampleRefusal::NotFalling };
            assert_eq!([0.015, -0.025].map(at), [Gate::Refuse(astray); 2]);
            assert_eq!(at(5.1), Gate::Refuse(SampleRefusal::TooFast), "{direction:?}");
        }
    }

    /// The rise ends at 10 kPa; the pump goes on to 12 and holds them for two seconds.
    #[test]
    fn a_fall_enters_from_where_the_rise_ended() {
        let (mut gauge, limits) = (GaugeHistory::default(), SessionLimits::default());
        let mut ramp = Ramp::new(ms(0), Direction::Rising, Some(ms(0)));
        let mut fell = Vec::new();
        for t in (0..26_000).step_by(50) {
            let seconds = t as f64 * 1e-3;
            gauge.push(ms(t), Kilopascal(seconds.min(12.0).min(26.0 - seconds)));
            match ramp.judge(ms(t), ms(t), &gauge, &limits) {
                Gate::Accept(kpa) if ramp.direction == Direction::Falling => fell.push(kpa.0),
                Gate::Accept(kpa) if kpa.0 >= 10.0 => ramp = ramp.turned(ms(t), &limits),
                _ => {}
            }
        }
        let mut at_once = Ramp::new(ms(0), Direction::Rising, Some(ms(0))).turned(ms(0), &limits);
        assert!(enters(at_once.judge(ms(25_500), ms(25_000), &gauge, &limits)), "there was no rise");
        assert!((9.8..=10.0).contains(&fell[0]) && fell[0] >= fell[1] && fell[fell.len() - 1] < 0.5, "{fell:?}");
    }

    proptest! {
        #[test]
        fn what_enters_never_goes_back_by_more_than_the_noise_band(
            steps in proptest::collection::vec(-0.2..0.3_f64, 100..400), falls: bool,
        ) {
            let (direction, sign) =
                if falls { (Direction::Falling, -1.0) } else { (Direction::Rising, 1.0) };
            let mut walk = vec![30.0];
            for s in &steps { walk.push(walk[walk.len() - 1] + sign * s); }
            let curve = |t: f64| walk[((t * 10.0) as usize).min(walk.len() - 1)];
            let accepted = run(direction, curve, 30);
            let mut furthest = f64::NEG_INFINITY;
            for p in accepted {
                prop_assert!(sign * p >= furthest - SessionLimits::default().noise_band.0 - 1e-12);
                furthest = furthest.max(sign * p);
            }
        }
    }
}
