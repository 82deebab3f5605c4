//! The clock of a log, made to go on where it was set.
//!
//! Whoever recorded may have set the clock, a robot may have had no time of its own at first, and files may have been joined in
//! another order than they were recorded in. Everything behind this takes time to go on: it would refuse what follows a
//! step back until it has caught up, and wait for years at a step forward. So from a step on a log's times are counted on
//! from the newest one, and the report says where and by how much.

use std::time::Duration;

use taxel_skin::Time;

/// Frames of several interfaces are written a little out of order; what is earlier by more than this is a clock that
/// was set.
const STEP_MIN: Duration = Duration::from_secs(1);

/// What is taken to have passed at a step back, which nobody knows: two scans of a skin board at its usual pace, so that none
/// of its scans comes too early and no board seems to fall silent.
const AT_STEP: Duration = Duration::from_millis(100);

/// No bus is silent for so long in one recording: the clock was set, or another recording follows.
const FORWARD_MIN: Duration = Duration::from_secs(24 * 3600);

/// What is taken to have passed at a step forward. Nobody saw the skin meanwhile: longer than any silence that a zero
/// outlives.
const AT_FORWARD: Duration = Duration::from_secs(10);

/// Where a log's clock was set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClockSteps {
    /// How many times.
    pub count: u64,
    /// The first of them.
    pub first: Option<ClockStep>,
    /// How much later than the log's own the times after the last of them are, nanoseconds; negative where they are earlier.
    pub shift_ns: i64,
}

/// One step of a log's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockStep {
    /// The first line after it, from 1.
    pub line: u64,
    /// By how much the time there is after the newest one, nanoseconds; negative for a step back.
    pub by_ns: i64,
}

impl ClockSteps {
    /// The steps in words, and what became of the times; `None` if there was no step.
    #[must_use]
    pub fn words(&self) -> Option<String> {
        let ClockStep { line, by_ns } = self.first?;
        let (by, shift) = (by_ns.unsigned_abs() as f64 * 1e-9, self.shift_ns.unsigned_abs() as f64 * 1e-9);
        let way = if by_ns < 0 { "back" } else { "forward" };
        let than = if self.shift_ns < 0 { "earlier" } else { "later" };
        let more = match self.count {
            1 => String::new(),
            2 => ", and at 1 more place".to_owned(),
            count => format!(", and at {} more places", count - 1),
        };
        Some(format!(
            "the clock stepped {way} by {by:.1} s at line {line}{more}: times go on from there, in the end {shift:.1} s {than} \
             than the log's"
        ))
    }
}

/// The clock of a log.
#[derive(Debug, Default)]
pub struct LogClock {
    /// The newest time that was given out.
    newest: Option<Time>,
}

/// When a frame was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// By the clock that goes on.
    pub time: Time,
    /// It is earlier than the newest, by no more than frames may be out of order.
    pub is_late: bool,
}

impl LogClock {
    /// Takes the time that is written in a line, and notes a step.
    pub fn read(&mut self, written: Time, line: u64, steps: &mut ClockSteps) -> Reading {
        let time = Time::from_nanos(written.as_nanos().saturating_add(steps.shift_ns));
        let newest = self.newest.unwrap_or(time);
        let passed = match (newest.since(time), time.since(newest)) {
            (back, _) if back > STEP_MIN => AT_STEP,
            (_, forward) if forward > FORWARD_MIN => AT_FORWARD,
            _ => {
                self.newest = Some(newest.max(time));
                return Reading { time, is_late: time < newest };
            }
        };
        let by_ns = time.as_nanos().saturating_sub(newest.as_nanos());
        steps.count += 1;
        steps.first.get_or_insert(ClockStep { line, by_ns });
        let next = newest + passed;
        steps.shift_ns = steps.shift_ns.saturating_add(next.as_nanos().saturating_sub(time.as_nanos()));
        self.newest = Some(next);
        Reading { time: next, is_late: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What becomes of times in seconds, one a line.
    fn read(written_s: &[f64]) -> (Vec<f64>, u64, ClockSteps) {
        let (mut clock, mut steps, mut late) = (LogClock::default(), ClockSteps::default(), 0);
        let mut times = Vec::new();
        for (time_s, line) in written_s.iter().zip(1..) {
            let reading = clock.read(Time::from_seconds(*time_s), line, &mut steps);
            late += u64::from(reading.is_late);
            times.push((reading.time.as_seconds() * 1e3).round() / 1e3);
        }
        (times, late, steps)
    }

    #[test]
    fn time_goes_on_where_the_clock_steps_back() {
        let (times, late, steps) = read(&[5000.0, 5000.5, 1400.0, 1400.5, 5000.0]);
        assert_eq!(times, [5000.0, 5000.5, 5000.6, 5001.1, 8600.6]);
        assert_eq!((late, steps.count), (0, 1));
        assert_eq!(
            steps.words().unwrap(),
            "the clock stepped back by 3600.5 s at line 3: times go on from there, in the end 3600.6 s later than the log's"
        );
        let (times, _, steps) = read(&[0.0, 2.0, 0.0, 2.0, 0.0, 2.0]);
        assert_eq!(times, [0.0, 2.0, 2.1, 4.1, 4.2, 6.2]);
        assert!(steps.words().unwrap().contains("by 2.0 s at line 3, and at 1 more place: "), "{steps:?}");
    }

    #[test]
    fn frames_out_of_order_keep_their_times() {
        let (times, late, steps) = read(&[10.0, 10.9, 9.9, 10.0, 11.0]);
        assert_eq!(times, [10.0, 10.9, 9.9, 10.0, 11.0]);
        assert_eq!((late, steps.words()), (2, None));
    }

    #[test]
    fn one_time_in_the_future_stops_nothing_after_it() {
        let (times, _, steps) = read(&[10.0, 4_000_000.0, 10.1, 10.2]);
        assert_eq!(times, [10.0, 20.0, 20.1, 20.2]);
        assert_eq!((steps.first.unwrap().line, steps.count), (2, 2));
    }

    /// A robot that learns what time it is after its start, and a night without a frame.
    #[test]
    fn time_goes_on_where_the_clock_is_set_forward() {
        let (times, late, steps) = read(&[12.0, 12.5, 1_760_000_000.0, 1_760_000_000.5]);
        assert_eq!(times, [12.0, 12.5, 22.5, 23.0]);
        assert_eq!((late, steps.count), (0, 1));
        assert_eq!(
            steps.words().unwrap(),
            "the clock stepped forward by 1759999987.5 s at line 3: times go on from there, in the end 1759999977.5 s earlier \
             than the log's"
        );
        let night = [0.0, 12.0 * 3600.0];
        let (times, _, steps) = read(&night);
        assert_eq!((times.as_slice(), steps.words()), (night.as_slice(), None));
    }

    #[test]
    fn the_end_of_all_time_is_no_overflow() {
        let (mut clock, mut steps) = (LogClock::default(), ClockSteps::default());
        for nanos in [i64::MAX, 0, i64::MAX, 0] {
            assert_eq!(clock.read(Time::from_nanos(nanos), 1, &mut steps).time, Time::from_nanos(i64::MAX));
        }
    }
}
