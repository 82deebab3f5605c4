//! The rules of a calibration session.

use std::time::Duration;
use taxel_skin::Kilopascal;

use crate::calibration::branch::Branch;
use crate::intake::gauge::RestLimits;

/// A spike is so many noise bands high.
const SPIKE_BANDS: f64 = 4.0;

/// While a zero is taken the pressure drifts by no more of a noise band in half a second: a bag that is still being vented presses
/// on the skin, and taxels that move while they are watched get no zero.
const DRIFT_BANDS: f64 = 0.25;

/// A scan enters the session when the zero has stood for so long after it. A board that takes a new zero unnoticed is
/// found within that time, and the scans with the wrong zero never get in.
pub const PROBATION: Duration = Duration::from_secs(1);

/// The rules of a calibration session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SessionLimits {
    /// A ramp ends by itself here.
    pub target: Kilopascal,
    /// Whether the skin lies in a chamber under pressure: then a target may lie above 95 kPa.
    pub pressurised_chamber: bool,
    /// A sample may lie this far behind the furthest pressure so far, on a rise below it: the gauge's noise.
    pub noise_band: Kilopascal,
    /// Whether no gauge says the pressure, but an operator who holds a plateau and types what a dial shows.
    pub typed: bool,
    /// Which branches of the pressure a ramp gathers, unless its session asks for others.
    pub branches: Branch,
    /// Steepest rise or fall that may enter the fit, in kPa/s.
    pub steepest_kpa_per_s: f64,
    /// The falling branch of a ramp ends by itself here.
    pub fall_end: Kilopascal,
    /// Whether the hysteresis of a session over both branches is compensated, if that wins on what no fit saw.
    pub plays: bool,
    /// Without a pressure frame for so long no scan can be paired.
    pub gauge_timeout: Duration,
    /// Without any pressure frame, or any rise, for so long the session fails; without any fall the ramp ends.
    pub patience: Duration,
    /// A ramp cannot start above this, and no zero is taken: the bag must be vented, and its gauge not be off by more. The
    /// gauge of a recorded rig reads 5.8 kPa at rest, so the default bears that; what it reads then is taken off, and target
    /// and end of the fall are counted from there.
    pub vented_below: Kilopascal,
    /// Most scans of one session; a ramp ends when they are full.
    pub scans_max: usize,
    /// A taxel responds once its count has moved so far, and by as much as the fit asks of it.
    pub responding_counts: u8,
}

/// A vacuum bag presses with no more than the ambient pressure, and no pump takes out all of it, kPa.
pub const BAG_MAX_KPA: f64 = 95.0;

/// No chamber for skin has more, kPa.
const CHAMBER_MAX_KPA: f64 = 1_000.0;

impl SessionLimits {
    /// The highest target, kPa.
    #[must_use]
    pub const fn target_max_kpa(&self) -> f64 {
        if self.pressurised_chamber { CHAMBER_MAX_KPA } else { BAG_MAX_KPA }
    }

    /// A reading further from the trend is the gauge's own doing. A real pressure that bends by so much within half a second
    /// is beyond the steepest slope anyway.
    #[must_use]
    pub fn spike_kpa(&self) -> f64 {
        SPIKE_BANDS * self.noise_band.0
    }

    /// How still the gauge has to be while its own zero is taken.
    #[must_use]
    pub fn gauge_rest(&self) -> RestLimits {
        RestLimits {
            drift_kpa: DRIFT_BANDS * self.noise_band.0,
            spike_kpa: self.spike_kpa(),
            timeout: self.gauge_timeout,
        }
    }
}

impl Default for SessionLimits {
    fn default() -> Self {
        Self {
            target: Kilopascal(70.0),
            pressurised_chamber: false,
            noise_band: Kilopascal(0.3),
            typed: false,
            branches: Branch::Rising,
            steepest_kpa_per_s: 5.0,
            fall_end: Kilopascal(1.0),
            plays: true,
            gauge_timeout: Duration::from_millis(500),
            patience: Duration::from_secs(60),
            vented_below: Kilopascal(10.0),
            scans_max: 36_000, // half an hour at 20 Hz
            responding_counts: 6,
        }
    }
}
