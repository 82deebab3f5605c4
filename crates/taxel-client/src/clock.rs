//! How long a message of the daemon was on its way, though sender and receiver have clocks of their own.
//!
//! That can be told only by what both clocks showed at one moment. A question and its answer bracket that
//! ([`DaemonClock::asked`]): the daemon answered not before the question left. So the time on the way is known up to the
//! time that the question itself took, and is never stated too small. Without a question it is counted from the quickest
//! message of the stream, which says nothing of how long that one took.

use std::time::{Duration, Instant};

/// Two clocks may part by so much, in seconds a second: the kernel sets a clock right by 500 ppm at most, and a crystal is
/// off by less than 100 ppm.
const DRIFT: f64 = 6e-4;

/// The daemon's clock against ours, as far as a stream and questions beside it have shown it.
#[derive(Clone, Debug)]
pub struct DaemonClock {
    begun: Instant,
    /// Our clock less the daemon's, by the quickest message; NaN until there is one.
    quickest_s: f64,
    /// The least that our clock less the daemon's can be, and when that was found.
    least: Option<(f64, Instant)>,
}

impl DaemonClock {
    /// Nothing is known yet; what follows is told from `begun` on.
    #[must_use]
    pub const fn new(begun: Instant) -> Self {
        Self { begun, quickest_s: f64::NAN, least: None }
    }

    /// A question left at `left`, and its answer was sent at `sent_s` of the daemon's clock, in seconds: later than it left.
    /// An answer without a finite time shows nothing.
    pub fn asked(&mut self, left: Instant, sent_s: Option<f64>) {
        let Some(sent_s) = sent_s.filter(|sent_s| sent_s.is_finite()) else { return };
        let least_s = self.ours_s(left) - sent_s;
        if self.least_at(left).is_none_or(|known| least_s > known) {
            self.least = Some((least_s, left));
        }
    }

    /// Whether an answer has shown the daemon's clock.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.least.is_some()
    }

    /// How long a message was on its way that came at `at` and was sent at `sent_s` of the daemon's clock: rather too long
    /// than too short, once an answer has shown that clock.
    pub fn delay(&mut self, at: Instant, sent_s: Option<f64>) -> Duration {
        let sent_s = sent_s.filter(|sent_s| sent_s.is_finite());
        let on_the_way_s = sent_s.map_or(f64::NAN, |sent_s| self.ours_s(at) - sent_s);
        self.quickest_s = self.quickest_s.min(on_the_way_s); // `min` takes the number where the other is NaN
        let least_s = self.least_at(at).unwrap_or(self.quickest_s);
        Duration::try_from_secs_f64(on_the_way_s - least_s).unwrap_or_default()
    }

    fn ours_s(&self, at: Instant) -> f64 {
        match at.checked_duration_since(self.begun) {
            Some(since) => since.as_secs_f64(),
            None => -self.begun.duration_since(at).as_secs_f64(),
        }
    }

    /// The least that our clock less the daemon's can be by now.
    fn least_at(&self, at: Instant) -> Option<f64> {
        let (least_s, found) = self.least?;
        Some(least_s - DRIFT * at.saturating_duration_since(found).as_secs_f64())
    }
}
