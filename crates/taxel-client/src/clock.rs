//! How long a message of the daemon was on its way, though sender and receiver have clocks of their own.
//!
//! That can be told only by what both clocks showed at one moment. A question and its answer bracket that
//! ([`DaemonClock::asked`]): the daemon answered not before the question left. So the time on the way is known up to the
//! time that the question itself took, and is never stated too small. Without a question it is counted from the quickest
//! message of the stream, which says nothing of how long that one took.

use std::time::Duration;

use crate::moment::Moment;

/// Two clocks may part by so much, in seconds a second: the kernel sets a clock right by 500 ppm at most, and a crystal is
/// off by less than 100 ppm.
const DRIFT: f64 = 6e-4;

/// A message does not come so long before it was sent, s, on clocks that run.
const ASTRAY_S: f64 = 0.05;

/// The daemon's clock against ours, as far as a stream and questions beside it have shown it.
#[derive(Clone, Debug, Default)]
pub struct DaemonClock {
    /// Our clock less the daemon's by the quickest message, and when that came.
    quickest: Option<(f64, Moment)>,
    /// The least that our clock less the daemon's can be, and when that was found.
    least: Option<(f64, Moment)>,
    /// The same before the last answer that raised it, and when that answer was sent by the daemon's clock: where that stood still
    /// meanwhile, as in a sleep of its machine, the answer says nothing of messages that were sent before.
    before: Option<((f64, Moment), f64)>,
}

impl DaemonClock {
    /// A question left at `left`, and its answer was sent at `sent_s` of the daemon's clock, in seconds: later than it left.
    /// An answer without a finite time shows nothing.
    pub fn asked(&mut self, left: Moment, sent_s: Option<f64>) {
        let Some(sent_s) = sent_s.filter(|sent_s| sent_s.is_finite()) else { return };
        let least_s = left.seconds() - sent_s;
        if known_at(self.least, left, -DRIFT).is_none_or(|known| least_s > known) {
            self.before = self.least.map(|known| (known, sent_s));
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
    pub fn delay(&mut self, at: Moment, sent_s: Option<f64>) -> Duration {
        let Some(sent_s) = sent_s.filter(|sent_s| sent_s.is_finite()) else { return Duration::ZERO };
        let on_the_way_s = at.seconds() - sent_s;
        // Of two clocks that part, none of the messages would be as quick any more as one of long ago.
        let quickest_s = known_at(self.quickest, at, DRIFT).map_or(on_the_way_s, |known| known.min(on_the_way_s));
        self.quickest = Some((quickest_s, at));
        let of_before = self.before.filter(|(_, until_s)| sent_s < *until_s).map(|(known, _)| known);
        let least_s = known_at(of_before.or(self.least), at, -DRIFT).unwrap_or(quickest_s);
        if on_the_way_s - least_s < -ASTRAY_S {
            // It came before it was sent: our clock has stood still, and nothing is known of the daemon's any more.
            *self = Self::default();
            return Duration::MAX;
        }
        Duration::try_from_secs_f64(on_the_way_s - least_s).unwrap_or_default()
    }
}

/// What is known of our clock less the daemon's, by now, where that moves by so much a second.
fn known_at(known: Option<(f64, Moment)>, at: Moment, drift: f64) -> Option<f64> {
    known.map(|(known_s, found)| known_s + drift * at.since(found).as_secs_f64())
}
