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

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Newton;

    #[test]
    fn an_interval_that_meets_the_truth_is_no_lie() {
        assert_eq!(judge((1.0, 2.0), (1.5, 1.5)), None);
        assert_eq!(judge((1.0, 2.0), (0.0, 1.0)), None);
        assert_eq!(judge((0.0, f64::INFINITY), (900.0, 900.0)), None);
        assert_eq!(judge((1.0, 2.0), (2.5, 3.0)), Some(Lie { too_little: true, excess_n: 0.5 }));
        assert_eq!(judge((1.0, 2.0), (0.0, 0.75)), Some(Lie { too_little: false, excess_n: 0.25 }));
        assert!(judge((f64::NAN, f64::NAN), (0.0, 0.0)).is_some());
    }

    #[test]
    fn a_sample_without_a_force_says_nothing_and_a_lower_bound_is_open() {
        let mut sample = ForceSample {
            state: ForceState::Ok,
            total: Some(Newton(5.0)),
            total_sigma: Some(Newton(0.5)),
            undetected: Some(Undetected { newton: 0.25, sigma_n: 0.0 }),
            ..ForceSample::default()
        };
        assert_eq!(Stated::of(&sample).unwrap().interval(LIE_SIGMAS), (3.5, 6.75));
        assert_eq!(Stated::of(&sample).unwrap().width_n(), 2.25);
        sample.unbounded = true;
        let stated = Stated::of(&sample).unwrap();
        assert_eq!(stated.interval(LIE_SIGMAS), (3.5, f64::INFINITY));
        assert_eq!((stated.closed(LIE_SIGMAS), stated.undetected_n()), ((3.5, 6.75), 0.25));
        sample.state = ForceState::Stale;
        assert_eq!(Stated::of(&sample), None);
    }
}
