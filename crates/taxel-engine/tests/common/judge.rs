//! Whether a published force holds the truth.

use taxel_engine::snapshot::{ForceSample, ForceState, Undetected};

/// Coverage factor of the interval of 95 %.
pub const SIGMAS: f64 = 2.0;
/// Coverage factor beyond which a force lies.
pub const LIE_SIGMAS: f64 = 3.0;
/// Rounding of sums, far below what anything here can weigh.
const TOLERANCE_N: f64 = 1e-6;

/// What a sample says of the force, in newton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    pub total: f64,
    pub sigma: f64,
    undetected: Undetected,
    /// Nothing bounds the force above.
    pub open: bool,
}

impl Stated {
    /// The one place that says what the interval of a sample is; `None` where it says nothing.
    pub fn of(force: &ForceSample) -> Option<Self> {
        if !matches!(force.state, ForceState::Ok | ForceState::Degraded) {
            return None;
        }
        let (total, sigma, undetected) = (force.total?.0, force.total_sigma?.0, force.undetected?);
        Some(Self { total, sigma, undetected, open: force.unbounded })
    }

    /// The interval at so many standard uncertainties.
    pub fn interval(&self, sigmas: f64) -> (f64, f64) {
        let (low, high) = self.closed(sigmas);
        (low, if self.open { f64::INFINITY } else { high })
    }

    /// What it would be if something bounded it: as [`ForceSample::least`] and [`ForceSample::most`].
    pub fn closed(&self, sigmas: f64) -> (f64, f64) {
        let low = (self.total - sigmas * self.sigma).max(0.0);
        (low, self.total + self.undetected.newton + sigmas * self.sigma.hypot(self.undetected.sigma_n))
    }

    /// How wide the interval of 95 % is.
    pub fn width_n(&self) -> f64 {
        let (low, high) = self.closed(SIGMAS);
        high - low
    }

    /// What may be there undetected, to 95 %.
    pub fn undetected_n(&self) -> f64 {
        self.undetected.newton + SIGMAS * self.undetected.sigma_n
    }
}

/// A force that was stated wrongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lie {
    /// It says too little; else too much.
    pub too_little: bool,
    /// How far the truth lies outside of the interval, in newton.
    pub excess_n: f64,
}

/// Judges an interval by the range in which the truth was.
pub fn judge((low, high): (f64, f64), (least, greatest): (f64, f64)) -> Option<Lie> {
    let (below, above) = (least - high, low - greatest);
    if below <= TOLERANCE_N && above <= TOLERANCE_N {
        return None;
    }
    let (too_little, excess_n) = if below >= above { (true, below) } else { (false, above) };
    // What is no number at all is as wrong as can be.
    Some(Lie { too_little, excess_n: if excess_n.is_nan() { f64::INFINITY } else { excess_n } })
}
