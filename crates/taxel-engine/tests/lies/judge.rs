//! Whether a published force holds the truth.

use taxel_engine::snapshot::{ForceSample, ForceState};

/// Coverage factor of the stated uncertainty.
const SIGMAS: f64 = 3.0;
/// Rounding of sums, far below what anything here can weigh.
const TOLERANCE_N: f64 = 1e-6;

/// What a sample says of the force, in newton; `None` where it says nothing. A lower bound is open above.
pub fn interval(force: &ForceSample) -> Option<(f64, f64)> {
    closed(force).map(|(low, high)| (low, if force.lower_bound { f64::INFINITY } else { high }))
}

/// What it would say if it were no lower bound.
pub fn closed(force: &ForceSample) -> Option<(f64, f64)> {
    if !matches!(force.state, ForceState::Ok | ForceState::Degraded) {
        return None;
    }
    let (total, sigma) = (force.total?.0, force.total_sigma?.0);
    let floor = force.detection_floor?.0;
    Some((total - SIGMAS * sigma, total + SIGMAS * sigma + floor))
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
            detection_floor: Some(Newton(0.25)),
            ..ForceSample::default()
        };
        assert_eq!(interval(&sample), Some((3.5, 6.75)));
        sample.lower_bound = true;
        assert_eq!(interval(&sample), Some((3.5, f64::INFINITY)));
        sample.state = ForceState::Stale;
        assert_eq!(interval(&sample), None);
    }
}
