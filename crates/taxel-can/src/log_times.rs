//! The times of a log, made to go on where its clock was set.
//!
//! The recording computer's clock may have been set, a robot may have had no time of its own at first, and files may have been joined in
//! another order than they were recorded in. Everything behind this takes time to go on: it would refuse what follows a
//! step back until it has caught up, and wait for years at a step forward. So from a step on a log's times are counted on
//! from the newest one, and the report says where.

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

/// What is known of the times of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogTimes {
    /// Times before an earlier one, by at most a second. They stay as they are.
    pub backwards: u64,
    /// How many times the clock was set.
    pub steps: u64,
    /// The line after the first of these, from 1, and by how much its time is after the newest one, nanoseconds.
    first_step: (u64, i64),
    /// The newest time that was given out.
    newest: Option<Time>,
    /// How much later than the log's own the times are now, nanoseconds.
    shift_ns: i64,
    /// Not all times are the same.
    differ: bool,
}

impl LogTimes {
    /// Takes the time that is written in a line; gives it on the clock that goes on.
    pub(crate) fn read(&mut self, written: Time, line: u64) -> Time {
        let time = Time::from_nanos(written.as_nanos().saturating_add(self.shift_ns));
        let newest = *self.newest.get_or_insert(time);
        self.differ |= time != newest;
        let passed = match (newest.since(time), time.since(newest)) {
            (back, _) if back > STEP_MIN => AT_STEP,
            (_, forward) if forward > FORWARD_MIN => AT_FORWARD,
            _ => {
                self.backwards += u64::from(time < newest);
                self.newest = Some(newest.max(time));
                return time;
            }
        };
        if self.steps == 0 {
            self.first_step = (line, time.as_nanos().saturating_sub(newest.as_nanos()));
        }
        self.steps += 1;
        let next = newest + passed;
        self.shift_ns = self.shift_ns.saturating_add(next.as_nanos().saturating_sub(time.as_nanos()));
        self.newest = Some(next);
        next
    }

    /// Where the clock was set, in words.
    pub(crate) fn step_words(&self) -> Option<String> {
        let (line, by_ns) = (self.steps > 0).then_some(self.first_step)?;
        let (way, by_s) = (if by_ns < 0 { "back" } else { "forward" }, by_ns.unsigned_abs() as f64 * 1e-9);
        let more = if self.steps > 1 { format!(" ({} more steps follow)", self.steps - 1) } else { String::new() };
        Some(format!("the clock stepped {way} by {by_s:.1} s at line {line}: times go on from there{more}"))
    }

    /// Why the times of so many frames tell nothing of pace and order; `None` where none was read from a text.
    pub(crate) fn fault(&self, frames: u64) -> Option<String> {
        self.newest?;
        if !self.differ {
            return Some(format!("all {frames} frames share one time: record without -H"));
        }
        (self.backwards > frames / 4).then(|| {
            format!(
                "{} of {frames} frames have a time before an earlier one: are these times from frame to frame, as `candump -td` \
                 writes them? Record with `candump -l` or `candump -ta`",
                self.backwards
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What becomes of times in seconds, one a line.
    fn read(written_s: &[f64]) -> (Vec<f64>, LogTimes) {
        let mut log = LogTimes::default();
        let mut on = |(at_s, line): (&f64, u64)| log.read(Time::from_seconds(*at_s), line).as_seconds();
        let times = written_s.iter().zip(1..).map(|of| (on(of) * 1e3).round() / 1e3).collect();
        (times, log)
    }

    #[test]
    fn time_goes_on_where_the_clock_steps_back() {
        let (times, log) = read(&[5000.0, 5000.5, 1400.0, 1400.5, 5000.0]);
        assert_eq!(times, [5000.0, 5000.5, 5000.6, 5001.1, 8600.6]);
        assert_eq!(log.step_words().unwrap(), "the clock stepped back by 3600.5 s at line 3: times go on from there");
        let (times, log) = read(&[0.0, 2.0, 0.0, 2.0, 0.0, 2.0]);
        assert_eq!(times, [0.0, 2.0, 2.1, 4.1, 4.2, 6.2]);
        assert!(log.step_words().unwrap().contains("by 2.0 s at line 3: times go on from there (1 more"), "{log:?}");
    }

    #[test]
    fn frames_out_of_order_keep_their_times() {
        let (times, log) = read(&[10.0, 10.9, 9.9, 10.0, 11.0]);
        assert_eq!(times, [10.0, 10.9, 9.9, 10.0, 11.0]);
        assert_eq!((log.backwards, log.step_words()), (2, None));
    }

    /// A robot that learns what time it is after its start, a night without a frame, and one time in the future.
    #[test]
    fn time_goes_on_where_the_clock_is_set_forward() {
        let (times, log) = read(&[12.0, 12.5, 1_760_000_000.0, 1_760_000_000.5]);
        assert_eq!(times, [12.0, 12.5, 22.5, 23.0]);
        assert!(log.step_words().unwrap().starts_with("the clock stepped forward by 1759999987.5 s at line 3"));
        let (times, log) = read(&[0.0, 12.0 * 3600.0]);
        assert_eq!((times.as_slice(), log.steps), ([0.0, 12.0 * 3600.0].as_slice(), 0));
        let (times, log) = read(&[10.0, 4_000_000.0, 10.1, 10.2]);
        assert_eq!((times.as_slice(), log.steps), ([10.0, 20.0, 20.1, 20.2].as_slice(), 2));
    }

    #[test]
    fn the_end_of_all_time_is_no_overflow() {
        let mut log = LogTimes::default();
        for nanos in [i64::MAX, 0, i64::MAX, 0] {
            assert_eq!(log.read(Time::from_nanos(nanos), 1), Time::from_nanos(i64::MAX));
        }
    }
}
