//! Figures of one series of errors: of a taxel, or of the mean over taxels.

use super::course::{Course, LEVELS};

/// What a series of errors (reading less reference) says.
pub(super) struct Figures {
    /// Root mean square, kPa.
    pub rmse_kpa: f64,
    /// Mean, kPa.
    pub bias_kpa: f64,
    /// Greatest absolute value, kPa.
    pub max_kpa: f64,
    /// Greatest difference of a level's mean error, falling less rising, kPa; `None` without both branches.
    pub hysteresis_kpa: Option<f64>,
    /// Standard deviation between ramps of a level's mean error on the rise, root mean square over the levels, kPa;
    /// `None` with a single ramp.
    pub repeatability_kpa: Option<f64>,
    /// Sums over ramps, branches and levels.
    pub sums: Vec<f64>,
}

impl Figures {
    /// Of one error per scan.
    pub(super) fn of(errors: &[f64], course: &Course) -> Self {
        let n = errors.len().max(1) as f64;
        let sums = course.sums(errors);
        Self {
            rmse_kpa: (errors.iter().map(|error| error * error).sum::<f64>() / n).sqrt(),
            bias_kpa: errors.iter().sum::<f64>() / n,
            max_kpa: errors.iter().fold(0.0, |max, error| error.abs().max(max)),
            hysteresis_kpa: hysteresis(course, &sums),
            repeatability_kpa: repeatability(course, &sums),
            sums,
        }
    }
}

fn hysteresis(course: &Course, sums: &[f64]) -> Option<f64> {
    let width = |level| Some(course.mean(sums, true, level)? - course.mean(sums, false, level)?);
    (0..LEVELS).filter_map(width).max_by(|a: &f64, b| a.abs().total_cmp(&b.abs()))
}

fn repeatability(course: &Course, sums: &[f64]) -> Option<f64> {
    let variance = |level| {
        let means: Vec<f64> = (0..course.ramps).filter_map(|ramp| course.mean_of_rise(sums, ramp, level)).collect();
        let n = means.len() as f64;
        let mean = means.iter().sum::<f64>() / n;
        (means.len() >= 2).then(|| means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0))
    };
    let variances: Vec<f64> = (0..LEVELS).filter_map(variance).collect();
    (!variances.is_empty()).then(|| (variances.iter().sum::<f64>() / variances.len() as f64).sqrt())
}
