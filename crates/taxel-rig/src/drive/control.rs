//! How a set point is moved so that the bag's pressure follows a ramp.
//!
//! A regulator takes its time and stops a little beside its set point; a pump has its own curve. So the loop is closed on the
//! bag's gauge: `set = reference + KP error + the integral of KI error`, `error = reference - gauge`. The reference waits for a bag
//! that does not follow, so that neither a dead time nor a pump at its end winds the integral up.

use std::time::Duration;

/// Share of the error that is added at once, and per second.
const KP: f64 = 0.4;
const KI_PER_S: f64 = 0.4;
/// The set point leads the reference by at most so much, kPa: a lag of several seconds at the usual rates.
const LEAD_MAX_KPA: f64 = 8.0;
/// The reference does not run further ahead of the bag, kPa.
const AHEAD_MAX_KPA: f64 = 1.0;

/// A ramp under way; pressures in kPa below ambient.
#[derive(Clone, Debug)]
pub(super) struct Control {
    reference_kpa: f64,
    end_kpa: f64,
    kpa_per_s: f64,
    lead_kpa: f64,
    at: Duration,
    /// When the reference went on last.
    moved: Duration,
}

impl Control {
    /// From what the gauge reads now to `end_kpa`, up or down.
    pub(super) fn new(now: Duration, gauge_kpa: f64, end_kpa: f64, kpa_per_s: f64) -> Self {
        Self { reference_kpa: gauge_kpa, end_kpa, kpa_per_s: kpa_per_s.abs(), lead_kpa: 0.0, at: now, moved: now }
    }

    /// The set point for now, 0 to `highest_kpa`.
    pub(super) fn set_kpa(&mut self, now: Duration, gauge_kpa: f64, highest_kpa: f64) -> f64 {
        let seconds = now.saturating_sub(self.at).as_secs_f64();
        self.at = now;
        let way = self.end_kpa - self.reference_kpa;
        let follows = (self.reference_kpa - gauge_kpa) * way.signum() < AHEAD_MAX_KPA;
        if follows {
            self.moved = now;
            self.reference_kpa += way.clamp(-self.kpa_per_s * seconds, self.kpa_per_s * seconds);
        }
        let error = self.reference_kpa - gauge_kpa;
        self.lead_kpa = (self.lead_kpa + KI_PER_S * error * seconds).clamp(-LEAD_MAX_KPA, LEAD_MAX_KPA);
        (self.reference_kpa + KP * error + self.lead_kpa).clamp(0.0, highest_kpa)
    }

    /// For how long the reference has waited for the bag.
    pub(super) fn stands_for(&self, now: Duration) -> Duration {
        now.saturating_sub(self.moved)
    }

    /// Whether the reference has come to its end.
    pub(super) fn is_at_end(&self) -> bool {
        (self.end_kpa - self.reference_kpa).abs() < 1e-6
    }
}
