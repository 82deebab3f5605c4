//! When a pushed scan came at the earliest: what was taken late may have waited in its socket, where nobody stamps it.
//!
//! A scan has the time at which it is taken, as long as its task runs every few milliseconds. Where it had
//! none for longer, because the process stood still or the machine was overloaded, a scan may have come as long ago as the turn
//! before. With the time at which it is taken it would look fresh, whatever has happened on the skin since. The same holds
//! for what is taken soon afterwards, since not all that has waited is read at once.

use std::time::Duration;

use taxel_skin::Time;

/// While nothing comes, a turn is due so often.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(5);

/// A turn so long after the one before is late; by so much may a scan be older than it says.
const LATE_AFTER: Duration = Duration::from_millis(10);

/// After a late turn for so long, all is read that has waited.
const READ_WITHIN: Duration = Duration::from_millis(20);

/// The turns of one stream of scans, and the times of the scans. It reads no clock.
#[derive(Debug)]
pub(crate) struct Arrivals {
    /// The last turn.
    looked: Time,
    /// The turn before a late one, and until when what is taken may be as old as that.
    late: Option<(Time, Time)>,
    /// The time of the newest scan.
    newest: Option<Time>,
}

impl Arrivals {
    /// Of a stream that begins now.
    pub(crate) const fn begin(now: Time) -> Self {
        Self { looked: now, late: None, newest: None }
    }

    /// There is a turn now; due at least every [`LOOK_EVERY`].
    pub(crate) fn look(&mut self, now: Time) {
        self.late = self.late.filter(|(_, until)| now < *until);
        if now.since(self.looked) > LATE_AFTER {
            let before = self.late.map_or(self.looked, |(before, _)| before);
            self.late = Some((before, now + READ_WITHIN));
        }
        self.looked = now;
    }

    /// When a scan that is taken now came at the earliest. Later scans have later times.
    pub(crate) fn take(&mut self, now: Time) -> Time {
        self.look(now);
        let earliest = self.late.map_or(now, |(before, _)| before);
        let time = self.newest.map_or(earliest, |newest| earliest.max(newest + Duration::from_nanos(1)));
        self.newest = Some(time);
        time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn at(ms: i64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    /// A stream that had its turns in time until 1 s.
    fn in_time() -> Arrivals {
        let mut arrivals = Arrivals::begin(at(0));
        (0..=200).for_each(|n| arrivals.look(at(5 * n)));
        arrivals
    }

    #[test]
    fn a_scan_that_is_taken_in_time_has_that_time() {
        let mut arrivals = in_time();
        for ms in [1_000, 1_003, 1_013, 1_013 + 10] {
            assert_eq!(arrivals.take(at(ms)), at(ms), "a turn may be a few milliseconds late");
        }
    }

    #[test]
    fn a_scan_that_may_have_waited_is_as_old_as_the_turn_before() {
        for gap_ms in [11, 40, 330, 60_000] {
            assert_eq!(in_time().take(at(1_000 + gap_ms)), at(1_000), "{gap_ms} ms");
            // Whichever has the first turn.
            let mut arrivals = in_time();
            arrivals.look(at(1_000 + gap_ms));
            assert_eq!(arrivals.take(at(1_000 + gap_ms)), at(1_000), "{gap_ms} ms");
        }
    }

    #[test]
    fn what_is_taken_soon_after_a_late_turn_may_have_waited_too() {
        let mut arrivals = in_time();
        arrivals.look(at(1_330));
        for ms in [1_331, 1_334, 1_339, 1_344, 1_349] {
            let time = arrivals.take(at(ms));
            assert!(time >= at(1_000) && time < at(1_000) + MS, "{time} at {ms} ms");
        }
        arrivals.look(at(1_354));
        assert_eq!(arrivals.take(at(1_359)), at(1_359), "by then all is read that has waited");
    }

    #[test]
    fn the_times_of_scans_go_on_and_no_two_are_the_same() {
        let mut arrivals = in_time();
        let scans = [1_002, 1_200, 1_200, 1_201, 1_206, 1_211, 1_216, 1_221, 1_221];
        let times: Vec<Time> = scans.iter().map(|ms| arrivals.take(at(*ms))).collect();
        assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
        assert_eq!((times[0], times[7]), (at(1_002), at(1_221)));
    }
}
