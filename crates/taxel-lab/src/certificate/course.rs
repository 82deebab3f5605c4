//! Which ramp, branch and pressure level each scan belongs to, and what a series of errors says over them.

use taxel_engine::calibration::{Branch, SessionSamples};
use taxel_engine::statistics::root_mean_square;

use crate::numbers::mean;

/// Levels of pressure that figures are told of, of equal width from 0 to the highest calibrated pressure.
pub(super) const LEVELS: usize = 10;

/// Fewest scans whose mean says something.
const SCANS_MIN: usize = 5;

/// The scans of a session in ramps, branches and levels.
pub(super) struct Course {
    /// Pressure of each scan, kPa.
    pub kpa: Vec<f64>,
    /// Seconds since the first scan.
    pub time_s: Vec<f64>,
    /// Position of each scan's ramp.
    pub ramp: Vec<usize>,
    /// How many ramps there are.
    pub ramps: usize,
    /// Whether each scan is on a falling branch.
    pub falling: Vec<bool>,
    /// Width of a level, kPa.
    pub level_kpa: f64,
    level: Vec<usize>,
}

/// What a series of errors (reading less reference) says, kPa.
pub(super) struct Figures {
    pub rmse: f64,
    pub bias: f64,
    /// Greatest absolute value.
    pub max: f64,
    /// Greatest difference of a level's mean error, falling less rising; `None` without both branches.
    pub hysteresis: Option<f64>,
    /// Standard deviation between ramps of a level's mean error on the rise, root mean square over the levels; `None` with a
    /// single ramp.
    pub repeatability: Option<f64>,
}

impl Course {
    /// Of a session whose highest calibrated pressure is `top_kpa`. A ramp rises up to its first scan of greatest
    /// pressure and falls thereafter; where only rising pressure was gathered all of it rises.
    pub(super) fn of(samples: &SessionSamples, branches: Branch, top_kpa: f64) -> Self {
        let first_ns = samples.samples.first().map_or(0, |sample| sample.time_ns);
        let kpa = samples.pressures_kpa();
        let position = |ramp: u16| samples.ramps.iter().position(|known| known.ramp == ramp).unwrap_or(0);
        let ramp: Vec<usize> = samples.samples.iter().map(|sample| position(sample.ramp)).collect();
        let seconds = |ns: i64| (ns.saturating_sub(first_ns) as f64 * 1e-3).round() * 1e-6; // as exported: microseconds
        let time_s = samples.samples.iter().map(|sample| seconds(sample.time_ns)).collect();
        let ramps = samples.ramps.len();
        let level_kpa = top_kpa / LEVELS as f64;
        let level = kpa.iter().map(|kpa| ((kpa / level_kpa).max(0.0) as usize).min(LEVELS - 1)).collect();
        let mut course = Self { falling: vec![false; kpa.len()], kpa, time_s, ramp, ramps, level_kpa, level };
        if branches == Branch::Both {
            let tops: Vec<_> = (0..ramps).map(|ramp| course.top(ramp)).collect();
            course.falling = (0..course.ramp.len()).map(|scan| Some(scan) > tops[course.ramp[scan]]).collect();
        }
        course
    }

    /// The scans of a ramp.
    pub(super) fn scans_of(&self, ramp: usize) -> impl DoubleEndedIterator<Item = usize> {
        (0..self.kpa.len()).filter(move |&scan| self.ramp[scan] == ramp)
    }

    /// The first scan of a ramp's greatest pressure.
    pub(super) fn top(&self, ramp: usize) -> Option<usize> {
        self.scans_of(ramp).rev().max_by(|&a, &b| self.kpa[a].total_cmp(&self.kpa[b]))
    }

    /// The scans of a level on a branch.
    pub(super) fn scans(&self, falling: bool, level: usize) -> impl Iterator<Item = usize> {
        (0..self.kpa.len()).filter(move |&scan| self.level[scan] == level && self.falling[scan] == falling)
    }

    /// Mean of a figure over a level on a branch; `None` with too few scans.
    pub(super) fn mean(&self, figure: &[f64], falling: bool, level: usize) -> Option<f64> {
        mean_of(figure, self.scans(falling, level))
    }

    /// What one error a scan says.
    pub(super) fn figures(&self, errors: &[f64]) -> Figures {
        let width = |level| Some(self.mean(errors, true, level)? - self.mean(errors, false, level)?);
        let of_rise = |ramp, level| mean_of(errors, self.scans(false, level).filter(|&scan| self.ramp[scan] == ramp));
        let of_ramps = |level| (0..self.ramps).filter_map(|ramp| of_rise(ramp, level)).collect::<Vec<_>>();
        let between: Vec<f64> = (0..LEVELS).filter_map(|level| deviation(&of_ramps(level))).collect();
        Figures {
            rmse: root_mean_square(errors.iter().copied()),
            bias: mean(errors.iter().copied()),
            max: errors.iter().fold(0.0, |max, error| error.abs().max(max)),
            hysteresis: (0..LEVELS).filter_map(width).max_by(|a: &f64, b| a.abs().total_cmp(&b.abs())),
            repeatability: (!between.is_empty()).then(|| root_mean_square(between.into_iter())),
        }
    }
}

fn mean_of(figure: &[f64], scans: impl Iterator<Item = usize>) -> Option<f64> {
    let values: Vec<f64> = scans.map(|scan| figure[scan]).collect();
    (values.len() >= SCANS_MIN).then(|| mean(values.into_iter()))
}

/// Standard deviation; `None` of fewer than two.
pub(super) fn deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values.iter().copied());
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() >= 2).then(|| (squares / (values.len() - 1) as f64).sqrt())
}
