//! Whether the engine runs: its task notes a time whenever it had its turn, and everybody can see how long ago that was.

use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use taxel_skin::Time;

use crate::clock::Clock;

/// The engine's task has its turn at least this often, also when nothing happens.
pub const BEAT_EVERY: Duration = Duration::from_millis(50);

/// An engine that had no turn for longer is stalled: what it published last may not be true any more. Two beats, so
/// that one late wake-up is no alarm.
pub const STALLED_AFTER: Duration = Duration::from_millis(100);

/// Before the first turn. Nothing can be published yet, so nothing can be wrong.
const NEVER: i64 = i64::MIN;

/// The time of the engine's last turn.
pub(crate) struct Heartbeat {
    clock: Clock,
    last_ns: AtomicI64,
}

impl Heartbeat {
    /// None yet.
    pub(crate) fn new(clock: Clock) -> Self {
        Self { clock, last_ns: AtomicI64::new(NEVER) }
    }

    /// The engine has its turn now. Gives for how long it had none, if it was stalled.
    pub(crate) fn beat(&self) -> Option<Duration> {
        let now = (self.clock)();
        let last_ns = self.last_ns.swap(now.as_nanos(), Ordering::Relaxed);
        let gap = silence(last_ns, now);
        (gap > STALLED_AFTER).then_some(gap)
    }

    /// For how long the engine has not run, if it is stalled.
    pub(crate) fn stalled_for(&self) -> Option<Duration> {
        let silence = self.silence();
        (silence > STALLED_AFTER).then_some(silence)
    }

    /// Whether there was a first turn.
    pub(crate) fn has_begun(&self) -> bool {
        self.last_ns.load(Ordering::Relaxed) != NEVER
    }

    /// How long ago the last turn was; nothing before the first.
    pub(crate) fn silence(&self) -> Duration {
        // Read before the clock: a beat in between would be taken for one of the future, which is no silence either.
        let last_ns = self.last_ns.load(Ordering::Relaxed);
        silence(last_ns, (self.clock)())
    }
}

fn silence(last_ns: i64, now: Time) -> Duration {
    if last_ns == NEVER { Duration::ZERO } else { now.since(Time::from_nanos(last_ns)) }
}
