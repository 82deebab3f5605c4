//! What one taxel's own counts say about it.

use std::time::Duration;
use taxel_skin::Time;

use super::fault::{Fault, FaultSet};
use super::limits::FaultLimits;

/// Changes that the noise is averaged over, about 3 s of a 27 Hz conversion.
const NOISE_CHANGES: f32 = 40.0;

/// Weight of the belief in no noise with which the average starts, in changes.
const NOISE_PRIOR: f32 = 8.0;

/// One product of successive changes counts for at most so much (10 counts squared): a single blow is no flicker.
const PRODUCT_MAX: f32 = 100.0;

/// How far back a flicker began when its noise passes the limit.
const FLICKER_LOOKBACK: Duration = Duration::from_millis(1500);

/// Noise from which on a taxel must change all the time, in steps of its converter.
const NOISE_SHOWS: f32 = 0.3;

/// A taxel is frozen after so many of its mean intervals between changes, where the noise is not known.
const INTERVALS: f32 = 20.0;

#[derive(Clone, Debug, Default)]
pub(super) struct TaxelWatch {
    pub(super) faults: FaultSet,
    /// Changed within the freezing time.
    pub(super) is_lively: bool,
    newest: f32,
    /// Whether there is a scan before the next one.
    begun: bool,
    changes: u32,
    last_change: Time,
    last_delta: f32,
    /// Mean of -d_k d_(k-1) over successive changes d: the variance of white noise. A ramp makes it negative, so that
    /// load is not taken for noise, and the repeats of a slow converter are skipped.
    variance: f32,
    mean_interval_s: f32,
    /// Noise that it is known to have at rest, counts.
    expected_noise: f32,
    /// With so much noise its converter never stands still.
    must_change: bool,
    /// Until when each is held; `None` is before any time.
    rail_until: Option<Time>,
    jump_until: Option<Time>,
    still_until: Option<Time>,
    since: Option<Time>,
}

impl TaxelWatch {
    /// So much noise at rest, in counts, of which its converter makes `steps_per_count` steps.
    pub(super) fn expect_noise(&mut self, noise: f32, steps_per_count: f32) {
        self.expected_noise = if noise.is_finite() { noise.max(0.0) } else { 0.0 };
        self.must_change = self.expected_noise * steps_per_count >= NOISE_SHOWS;
    }

    /// What it is known to have, counts; 0 if that is not known.
    pub(super) const fn noise(&self) -> f32 {
        self.expected_noise
    }

    /// The scans before a silence say nothing about those after it.
    pub(super) fn forget_trend(&mut self) {
        self.begun = false;
        self.changes = 0;
        self.last_delta = 0.0;
        self.variance = 0.0;
    }

    /// Takes a count and judges it. `others_change`: enough of the patch is lively to expect life of this taxel too.
    ///
    /// Returns whether the taxel is plainly sound, which it nearly always is: it has no fault, so none is held, and gives no
    /// reason for one; then none of the watches would change it.
    pub(super) fn push(
        &mut self,
        now: Time,
        count: f32,
        others_change: bool,
        hold: Duration,
        limits: &FaultLimits,
    ) -> bool {
        let newest = std::mem::replace(&mut self.newest, count);
        let still_s = if self.begun { self.change(now, count - newest) } else { self.begin_at(now) };
        if self.is_plainly_sound(still_s, limits) {
            self.is_lively = true;
            return true;
        }
        self.watch_rails(now, hold, limits);
        self.watch_jumps(now, hold, limits);
        self.watch_stillness(now, others_change, hold, limits);
        self.note_onset(now);
        false
    }

    /// The first count changes nothing; it has stood for no time.
    fn begin_at(&mut self, now: Time) -> f32 {
        self.begun = true;
        self.last_change = now;
        0.0
    }

    fn is_plainly_sound(&self, still_s: f32, limits: &FaultLimits) -> bool {
        let on_at = self.jumps_on_at(limits);
        self.faults.is_empty()
            & (self.newest > limits.rail_low)
            & (self.newest < limits.rail_high)
            & (self.variance <= on_at * on_at)
            & (self.changes > 0)
            & (still_s <= limits.frozen_after_s)
    }

    /// The noise from which on it is jumping, counts.
    fn jumps_on_at(&self, limits: &FaultLimits) -> f32 {
        limits.jump_on_counts.max(4.0 * self.expected_noise)
    }

    /// Takes the difference to the scan before; none changes nothing. Returns for how many seconds the count has stood. No
    /// branches: whether a count changes is as good as random, and a processor that guesses wrong every other time would
    /// take longer for it than for the sums.
    fn change(&mut self, now: Time, delta: f32) -> f32 {
        let changed = delta != 0.0;
        let (one, none) = (f32::from(u8::from(changed)), f32::from(u8::from(!changed)));
        let interval = now.seconds_since(self.last_change) as f32;
        self.mean_interval_s += (interval - self.mean_interval_s) * (one * self.weight(1.0));
        let product = (-delta * self.last_delta).clamp(-PRODUCT_MAX, PRODUCT_MAX);
        // The first change follows none: both are 0 then.
        self.variance += (product - self.variance) * (one * self.weight(NOISE_PRIOR));
        self.changes = self.changes.saturating_add(u32::from(changed));
        self.last_delta = delta + none * self.last_delta;
        self.last_change = if changed { now } else { self.last_change };
        none * interval
    }

    /// What the newest change counts in an average that began with a belief worth `prior` changes.
    fn weight(&self, prior: f32) -> f32 {
        let changes = self.changes as f32;
        if changes < NOISE_CHANGES { (1.0 / NOISE_CHANGES).max(1.0 / (changes + prior)) } else { 1.0 / NOISE_CHANGES }
    }

    fn watch_rails(&mut self, now: Time, hold: Duration, limits: &FaultLimits) {
        let count = self.newest;
        if count <= limits.rail_low || count >= limits.rail_high {
            self.rail_until = Some(now + hold);
            self.begin(now);
        }
        let on = Some(now) < self.rail_until;
        self.faults.set(Fault::Rail, on);
    }

    fn watch_jumps(&mut self, now: Time, hold: Duration, limits: &FaultLimits) {
        let on_at = self.jumps_on_at(limits);
        let off_at = on_at * limits.jump_off_counts / limits.jump_on_counts;
        let was = self.faults.contains(Fault::Jumping);
        if self.variance > on_at * on_at || (was && self.variance > off_at * off_at) {
            self.jump_until = Some(now + hold);
            if !was {
                self.begin(now - FLICKER_LOOKBACK);
            }
        }
        let on = Some(now) < self.jump_until;
        self.faults.set(Fault::Jumping, on);
    }

    fn watch_stillness(&mut self, now: Time, others_change: bool, hold: Duration, limits: &FaultLimits) {
        let still_s = now.seconds_since(self.last_change) as f32;
        self.is_lively = self.changes > 0 && still_s <= limits.frozen_after_s;
        let expected = self.must_change || others_change;
        let patience = if self.must_change { 0.0 } else { INTERVALS * self.mean_interval_s };
        let frozen = expected && self.changes > 0 && still_s > limits.frozen_after_s.max(patience);
        let dead = expected && self.changes == 0 && still_s > limits.dead_after_s;
        if frozen || dead {
            self.begin(self.last_change);
            self.still_until = Some(now + hold);
        }
        let held = Some(now) < self.still_until;
        self.faults.set(Fault::Dead, dead || (held && self.faults.contains(Fault::Dead)));
        self.faults.set(Fault::Frozen, frozen || (held && self.faults.contains(Fault::Frozen)));
    }

    fn begin(&mut self, at: Time) {
        self.since = Some(self.since.map_or(at, |since| since.min(at)));
    }

    /// Keeps the onset in step with the faults, also those that the module sets.
    pub(super) fn note_onset(&mut self, now: Time) {
        match (self.faults.is_empty(), self.since) {
            (true, _) => self.since = None,
            (false, None) => self.since = Some(now),
            _ => {}
        }
    }

    pub(super) fn wrong_since(&self) -> Option<Time> {
        self.since
    }
}
