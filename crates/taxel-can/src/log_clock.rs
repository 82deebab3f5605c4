//! The clock of a log, made to go on where it steps back.
//!
//! Whoever recorded may have set the clock, and files may have been joined in another order than they were recorded in.
//! Everything behind this takes time to go on, and would refuse what follows until it has caught up. So from a step on
//! a log's times are counted on from the newest one, and the report says where and by how much.

use std::time::Duration;

use taxel_skin::Time;

/// Frames of several interfaces are written a little out of order; what is earlier by more than this is a clock that
/// was set.
const STEP_MIN: Duration = Duration::from_secs(1);

/// What is taken to have passed at a step, which nobody knows: two scans of a skin board at its usual pace, so that none of
/// its scans comes too early and no board seems to fall silent.
const AT_STEP: Duration = Duration::from_millis(100);

/// Where a log's clock stepped back.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClockSteps {
    /// How many times.
    pub count: u64,
    /// The first of them.
    pub first: Option<ClockStep>,
    /// How much later than the log's own the times after the last of them are.
    pub shift: Duration,
}

/// One step of a log's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockStep {
    /// The first line after it, from 1.
    pub line: u64,
    /// By how much the time there is before the newest one.
    pub back: Duration,
}

impl ClockSteps {
    /// The steps in words, and what became of the times; `None` if there was no step.
    #[must_use]
    pub fn words(&self) -> Option<String> {
        let ClockStep { line, back } = self.first?;
        let (back, shift) = (back.as_secs_f64(), self.shift.as_secs_f64());
        let more = match self.count {
            1 => String::new(),
            2 => ", and at 1 more place".to_owned(),
            count => format!(", and at {} more places", count - 1),
        };
        Some(format!(
            "the clock stepped back by {back:.1} s at line {line}{more}: times go on from there, in the end {shift:.1} s later \
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
        let time = written + steps.shift;
        let newest = self.newest.unwrap_or(time);
        let back = newest.since(time);
        if back <= STEP_MIN {
            self.newest = Some(newest.max(time));
            return Reading { time, is_late: time < newest };
        }
        steps.count += 1;
        steps.first.get_or_insert(ClockStep { line, back });
        steps.shift = steps.shift.saturating_add(back + AT_STEP);
        let time = newest + AT_STEP;
        self.newest = Some(time);
        Reading { time, is_late: false }
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
        assert_eq!(times, [10.0, 4_000_000.0, 4_000_000.1, 4_000_000.2]);
        assert_eq!(steps.first.unwrap().line, 3);
    }

    #[test]
    fn the_end_of_all_time_is_no_overflow() {
        let (mut clock, mut steps) = (LogClock::default(), ClockSteps::default());
        for nanos in [i64::MAX, 0, i64::MAX, 0] {
            assert_eq!(clock.read(Time::from_nanos(nanos), 1, &mut steps).time, Time::from_nanos(i64::MAX));
        }
    }
}
