//! From where on a taxel counts as faulty.

/// Limits of the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultLimits {
    /// A count at or below is on the lower rail.
    pub rail_low: f32,
    /// A count at or above is on the upper rail.
    pub rail_high: f32,
    /// A lively taxel is frozen after so many seconds without a change; sound ones stay below 1.2 s.
    pub frozen_after_s: f32,
    /// A taxel that has never changed is dead after so many seconds.
    pub dead_after_s: f32,
    /// Back-and-forth noise (standard deviation, counts) above which a taxel is jumping ...
    pub jump_on_counts: f32,
    /// ... and below which it is not any more.
    pub jump_off_counts: f32,
    /// Share of a module's taxels that jump or sit on a rail, from which on the whole module is flickering.
    /// Above one half: one of a module's two converters may flicker alone.
    pub module_share: f32,
    /// A fault is over when its cause has been absent for so many seconds.
    pub hold_s: f32,
    /// What was before so many seconds of silence says nothing of what comes.
    pub stale_after_s: f32,
}

impl Default for FaultLimits {
    fn default() -> Self {
        Self {
            rail_low: 0.0,
            rail_high: 255.0,
            frozen_after_s: 2.0,
            dead_after_s: 3.0,
            jump_on_counts: 4.0,
            jump_off_counts: 3.0,
            module_share: 0.7,
            hold_s: 2.0,
            stale_after_s: 1.0,
        }
    }
}

/// The period up to which the times of the default limits are right.
const PERIOD_MAX_S: f32 = 0.2;

impl FaultLimits {
    /// The same for scans that come every so many seconds: at slow ones every time is as many scans longer.
    pub fn at_period(self, period_s: f32) -> Self {
        let slower = (period_s / PERIOD_MAX_S).max(1.0);
        Self {
            frozen_after_s: self.frozen_after_s * slower,
            dead_after_s: self.dead_after_s * slower,
            hold_s: self.hold_s * slower,
            stale_after_s: self.stale_after_s * slower,
            ..self
        }
    }
}
