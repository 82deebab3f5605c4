//! How often a module sends: never faster than its board can, or the frames are not what they seem.
//!
//! Frames carry neither a counter nor a time of their own. Two things make more scans than a board sends: a queue
//! somewhere on the way that lets old frames go at once, and a second node that uses the board's identifier. In both
//! cases some of the values are wrong and nothing in a frame says which. So at most one scan a period is taken, with
//! a tolerance of half a period for what the bus delays (the generic cell rate algorithm of ITU-T I.371). One scan too
//! many takes the module out for two periods, a second one within `MEMORY` for a whole second.
//!
//! A board that steadily sends faster than configured is no such case: after `STEADY` of even intervals its own period
//! is taken, and the health says that the configuration has another. But a board changes its pace only where it starts
//! anew. One that has kept the period that is taken for `STEADY` and then seems to send twice as often is two nodes, half
//! a period apart: the module stays out for as long as both send. After a silence of `BREAK` it may have started anew.

use std::time::Duration;
use taxel_skin::Time;

/// A scan may come so much of a period early.
const TOLERANCE_SHARE: f64 = 0.5;
/// Periods are taken a little short, so that a board whose clock is fast does not use up the tolerance.
const PERIOD_SHARE: f64 = 0.97;
/// A second scan too many within this time is no accident.
const MEMORY: Duration = Duration::from_secs(1);
/// So long a module is out after that.
const HOLD: Duration = Duration::from_secs(1);
/// Even intervals over so long a time are the board's own period.
const STEADY: Duration = Duration::from_secs(2);
/// After so long a silence a board may have started anew, at another pace.
const BREAK: Duration = Duration::from_secs(1);
/// No board scans its modules faster.
const PERIOD_MIN: Duration = Duration::from_millis(5);
/// Intervals within this share of their mean are even.
const EVEN_SHARE: f64 = 0.25;
/// Weight of a new interval in the mean.
const MEAN_SHARE: f64 = 0.1;
/// A board whose period is off by more than this share is worth a word.
const WORD_SHARE: f64 = 0.2;

/// The pace of one module.
#[derive(Clone, Debug)]
pub struct Pace {
    configured: Duration,
    /// The period that is taken.
    period: Duration,
    /// [`PERIOD_SHARE`] and [`TOLERANCE_SHARE`] of it.
    least: Duration,
    tolerance: Duration,
    /// When the next scan is due at the earliest, without the tolerance.
    due: Option<Time>,
    last: Option<Time>,
    mean_s: f64,
    /// Since when the intervals have been even.
    even_since: Option<Time>,
    /// When the last scan too many came, and how many did in all.
    excess: (Option<Time>, u64),
    /// Since when, from its start on, no scan was too many.
    kept_since: Option<Time>,
    /// It has kept the period taken for [`STEADY`] since its start: from now on it is no faster.
    is_proven: bool,
}

impl Pace {
    /// A module that should send at this period, which is not zero.
    pub fn new(period: Duration) -> Self {
        Self {
            configured: period,
            period,
            least: period.mul_f64(PERIOD_SHARE),
            tolerance: period.mul_f64(TOLERANCE_SHARE),
            due: None,
            last: None,
            mean_s: 0.0,
            even_since: None,
            excess: (None, 0),
            kept_since: None,
            is_proven: false,
        }
    }

    fn believe(&mut self, period: Duration) {
        self.period = period;
        (self.least, self.tolerance) = (period.mul_f64(PERIOD_SHARE), period.mul_f64(TOLERANCE_SHARE));
        self.due = None;
    }

    /// Its board is configured, and sends at the configured period from now on.
    pub fn on_bring_up(&mut self) {
        *self = Self { excess: self.excess, ..Self::new(self.configured) };
    }

    /// A scan of the module came. If the board cannot have sent it then: until when neither it nor what came before can be trusted.
    pub fn on_scan(&mut self, time: Time) -> Option<Time> {
        let begins = self.last.is_none_or(|last| time.since(last) >= BREAK);
        // Where two nodes sent before the break, two may come back from it.
        let crowded = self.excess.0.zip(self.last).is_some_and(|(excess, last)| last.since(excess) <= MEMORY);
        if begins && !(self.is_proven && crowded) {
            (self.kept_since, self.is_proven) = (Some(time), false);
        }
        self.learn(time);
        if let Some(due) = self.due
            && time < due - self.tolerance
        {
            let again = self.excess.0.is_some_and(|before| time.since(before) <= MEMORY);
            self.excess = (Some(time), self.excess.1 + 1);
            self.kept_since = Some(time);
            return Some(time + if again { HOLD } else { 2 * self.period });
        }
        self.due = Some(self.due.map_or(time, |due| due.max(time)) + self.least);
        self.is_proven |= self.kept_since.is_some_and(|since| time.since(since) >= STEADY);
        None
    }

    /// Follows the mean interval, and believes another period once it has been kept for long enough.
    fn learn(&mut self, time: Time) {
        let Some(last) = self.last.replace(time) else { return };
        let interval_s = time.seconds_since(last);
        let even = (interval_s - self.mean_s).abs() <= EVEN_SHARE * self.mean_s;
        if !even {
            self.mean_s = interval_s.max(0.0);
            self.even_since = Some(time);
            return;
        }
        self.mean_s += MEAN_SHARE * (interval_s - self.mean_s);
        let steady = self.even_since.is_some_and(|since| time.since(since) >= STEADY);
        let faster = self.mean_s < (1.0 - WORD_SHARE) * self.period.as_secs_f64();
        if steady && faster && !self.is_proven && self.mean_s >= PERIOD_MIN.as_secs_f64() {
            self.believe(Duration::from_secs_f64(self.mean_s));
        }
    }

    /// The interval at which the module has been sending evenly, where that is not the configured one.
    pub fn unlike_configured(&self) -> Option<Duration> {
        let (last, since) = (self.last?, self.even_since?);
        let configured_s = self.configured.as_secs_f64();
        let off = (self.mean_s - configured_s).abs() > WORD_SHARE * configured_s;
        (off && last.since(since) >= STEADY).then(|| Duration::from_secs_f64(self.mean_s))
    }

    /// Scans that came when the board cannot have sent them: when the last one did, and how many in all.
    pub const fn excess(&self) -> (Option<Time>, u64) {
        self.excess
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PERIOD: Duration = Duration::from_millis(50);

    fn ms(ms: f64) -> Time {
        Time::from_nanos((ms * 1e6) as i64)
    }

    fn refused(pace: &mut Pace, times_ms: impl IntoIterator<Item = f64>) -> Vec<f64> {
        times_ms.into_iter().filter(|&t| pace.on_scan(ms(t)).is_some()).collect()
    }

    proptest! {
        #[test]
        fn a_board_on_a_busy_bus_is_taken(
            late in proptest::collection::vec(0.0..20.0_f64, 400), ppm in -5_000.0..5_000.0_f64,
        ) {
            let mut pace = Pace::new(PERIOD);
            let times = late.iter().enumerate().map(|(i, late)| i as f64 * 50.0 * (1.0 + ppm * 1e-6) + late);
            prop_assert_eq!(refused(&mut pace, times), Vec::<f64>::new());
        }
    }

    #[test]
    fn the_second_scan_too_many_takes_the_module_out_for_longer() {
        let mut pace = Pace::new(PERIOD);
        pace.on_scan(ms(0.0));
        assert_eq!(pace.on_scan(ms(10.0)), Some(ms(110.0)));
        assert_eq!(pace.on_scan(ms(50.0)), None);
        assert_eq!(pace.on_scan(ms(60.0)), Some(ms(1_060.0)));
    }

    /// Its scans come as evenly as those of a board with half the period.
    #[test]
    fn a_second_node_half_a_period_away_is_never_taken_for_the_board_s_own_pace() {
        for phase in [12.5, 20.0, 25.0, 30.0, 37.5] {
            let mut pace = Pace::new(PERIOD);
            assert!(refused(&mut pace, (0..60).map(|i| f64::from(i) * 50.0)).is_empty());
            let both = (60..1_200).flat_map(|i| [f64::from(i) * 50.0, f64::from(i) * 50.0 + phase]);
            let (mut out_until, mut taken) = (ms(0.0), 0);
            for time in both.map(ms) {
                match pace.on_scan(time) {
                    Some(until) => out_until = out_until.max(until),
                    None => taken += u32::from(time > ms(3_200.0) && time >= out_until),
                }
            }
            assert_eq!(taken, 0, "scans of one of two nodes while the module is in use, {phase} ms apart");
            // Neither does a second without frames make one board of them.
            let both = (1_224..1_400).flat_map(|i| [f64::from(i) * 50.0, f64::from(i) * 50.0 + phase]);
            assert!(refused(&mut pace, both).len() > 80);
            // The second node goes, and what is left is the board as it was.
            assert!(refused(&mut pace, (1_440..1_500).map(|i| f64::from(i) * 50.0)).is_empty());
        }
    }

    #[test]
    fn a_board_that_is_configured_sends_at_the_configured_period_from_then_on() {
        let mut pace = Pace::new(PERIOD);
        refused(&mut pace, (0..200).map(|i| f64::from(i) * 25.0));
        assert!(refused(&mut pace, (200..240).map(|i| f64::from(i) * 25.0)).is_empty(), "it is taken");
        pace.on_bring_up();
        let found = refused(&mut pace, (120..160).flat_map(|i| [f64::from(i) * 50.0, f64::from(i) * 50.0 + 25.0]));
        assert!(found.len() > 10, "{found:?}");
    }

    #[test]
    fn a_board_that_starts_anew_may_have_another_pace() {
        let mut pace = Pace::new(PERIOD);
        assert!(refused(&mut pace, (0..100).map(|i| f64::from(i) * 50.0)).is_empty());
        let late = refused(&mut pace, (0..300).map(|i| 5_950.0 + f64::from(i) * 20.0));
        assert!(late.last().is_some_and(|last| *last < 8_100.0), "{:?}", late.last());
        assert_eq!(pace.unlike_configured().map(|d| d.as_millis()), Some(20));
    }
}
