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

/// Noise from which on a taxel must change all the time, counts.
const NOISE_SHOWS: f32 = 0.3;

/// A taxel is frozen after so many of its mean intervals between changes, where the noise is not known.
const INTERVALS: f32 = 20.0;

#[derive(Clone, Debug, Default)]
pub(super) struct TaxelWatch {
    pub(super) faults: FaultSet,
    /// Changed within the freezing time.
    pub(super) is_lively: bool,
    newest: f32,
    scans: u32,
    changes: u32,
    last_change: Time,
    last_delta: f32,
    /// Mean of -d_k d_(k-1) over successive changes d: the variance of white noise. A ramp makes it negative, so that
    /// load is not taken for noise, and the repeats of a slow converter are skipped.
    variance: f32,
    mean_interval_s: f32,
    expected_noise: f32,
    rail_until: Option<Time>,
    jump_until: Option<Time>,
    still_until: Option<Time>,
    since: Option<Time>,
}

impl TaxelWatch {
    pub(super) fn expect_noise(&mut self, noise: f32) {
        self.expected_noise = if noise.is_finite() { noise.max(0.0) } else { 0.0 };
    }

    /// The scans before a silence say nothing about those after it.
    pub(super) fn forget_trend(&mut self) {
        self.scans = 0;
        self.changes = 0;
        self.last_delta = 0.0;
        self.variance = 0.0;
    }

    /// `others_change`: enough of the patch is lively to expect life of this taxel too.
    pub(super) fn push(&mut self, now: Time, count: f32, others_change: bool, hold: Duration, limits: &FaultLimits) {
        let delta = count - std::mem::replace(&mut self.newest, count);
        self.scans = self.scans.saturating_add(1);
        if self.scans == 1 {
            self.last_change = now;
        } else if delta != 0.0 {
            self.change(now, delta);
        }
        self.watch_rails(now, count, hold, limits);
        self.watch_jumps(now, hold, limits);
        self.watch_stillness(now, others_change, hold, limits);
    }

    fn change(&mut self, now: Time, delta: f32) {
        let interval = now.seconds_since(self.last_change) as f32;
        let weight = (1.0 / NOISE_CHANGES).max(1.0 / (self.changes as f32 + 1.0));
        self.mean_interval_s += (interval - self.mean_interval_s) * weight;
        if self.changes > 0 {
            let product = (-delta * self.last_delta).clamp(-PRODUCT_MAX, PRODUCT_MAX);
            let weight = (1.0 / NOISE_CHANGES).max(1.0 / (self.changes as f32 + NOISE_PRIOR));
            self.variance += (product - self.variance) * weight;
        }
        self.changes = self.changes.saturating_add(1);
        self.last_delta = delta;
        self.last_change = now;
    }

    fn watch_rails(&mut self, now: Time, count: f32, hold: Duration, limits: &FaultLimits) {
        if count <= limits.rail_low || count >= limits.rail_high {
            self.rail_until = Some(now + hold);
            self.begin(now);
        }
        let on = self.rail_until.is_some_and(|until| now < until);
        self.faults.set(Fault::Rail, on);
    }

    fn watch_jumps(&mut self, now: Time, hold: Duration, limits: &FaultLimits) {
        let on_at = limits.jump_on_counts.max(4.0 * self.expected_noise);
        let off_at = on_at * limits.jump_off_counts / limits.jump_on_counts;
        let was = self.faults.contains(Fault::Jumping);
        if self.variance > on_at * on_at || (was && self.variance > off_at * off_at) {
            self.jump_until = Some(now + hold);
            if !was {
                self.begin(now - FLICKER_LOOKBACK);
            }
        }
        let on = self.jump_until.is_some_and(|until| now < until);
        self.faults.set(Fault::Jumping, on);
    }

    fn watch_stillness(&mut self, now: Time, others_change: bool, hold: Duration, limits: &FaultLimits) {
        let still_s = now.seconds_since(self.last_change) as f32;
        self.is_lively = self.changes > 0 && still_s <= limits.frozen_after_s;
        let must_change = self.expected_noise >= NOISE_SHOWS;
        let expected = must_change || others_change;
        let patience = if must_change { 0.0 } else { INTERVALS * self.mean_interval_s };
        let frozen = expected && self.changes > 0 && still_s > limits.frozen_after_s.max(patience);
        let dead = expected && self.changes == 0 && still_s > limits.dead_after_s;
        if frozen || dead {
            self.begin(self.last_change);
            self.still_until = Some(now + hold);
        }
        let held = self.still_until.is_some_and(|until| now < until);
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
