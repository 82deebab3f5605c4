//! Compares the pressures read with those of the gauge.

use crate::calibration::fit::apply::Applied;
use crate::statistics::{mean, quantile, root_mean_square};

/// Below this pressure a relative error says little, kPa.
const RELATIVE_ABOVE_KPA: f64 = 30.0;

/// Of a normal distribution 95 % lie within so many standard deviations.
const WITHIN_95: f64 = 1.96;

/// How good the pressures of a recording are.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Mean of |mean over the taxels - P| / P over all scans above 30 kPa, in percent.
    pub area_percent: f64,
    /// Mean over those scans of (mean over the taxels - P), kPa.
    pub bias_kpa: f64,
    /// Mean over the taxels of each one's root mean square error, kPa.
    pub taxel_rmse_kpa: f64,
    /// Their median.
    pub taxel_rmse_median_kpa: f64,
    /// Taxels that were read.
    pub taxels: usize,
    /// Share of the readings within 1.96 standard deviations of the gauge, in percent; `None` without deviations.
    pub coverage_percent: Option<f64>,
}

/// Judges `applied` against the gauge, kPa, one value per scan.
#[must_use]
pub fn judge(applied: &Applied, gauge_kpa: &[f64]) -> Score {
    let columns: Vec<&Vec<f64>> = applied.pressure_kpa.iter().filter(|column| !column.is_empty()).collect();
    let area = |i: usize| mean(columns.iter().map(|column| column[i])).0 - gauge_kpa[i];
    let high = || (0..gauge_kpa.len()).filter(|&i| gauge_kpa[i] > RELATIVE_ABOVE_KPA);
    let errors: Vec<f64> =
        columns.iter().map(|c| root_mean_square(c.iter().zip(gauge_kpa).map(|(read, p)| read - p))).collect();
    let (mut within, mut all) = (0_u64, 0_u64);
    for (kpa, sigma) in applied.pressure_kpa.iter().zip(&applied.sigma_kpa) {
        for ((read, sigma), p) in kpa.iter().zip(sigma).zip(gauge_kpa).filter(|((r, _), p)| (*r - *p).is_finite()) {
            all += 1;
            within += u64::from((read - p).abs() <= WITHIN_95 * sigma);
        }
    }
    Score {
        area_percent: 100.0 * mean(high().map(|i| area(i).abs() / gauge_kpa[i])).0,
        bias_kpa: mean(high().map(area)).0,
        taxel_rmse_kpa: mean(errors.iter().copied()).0,
        taxel_rmse_median_kpa: quantile(errors, 0.5).unwrap_or(f64::NAN),
        taxels: columns.len(),
        coverage_percent: (all > 0).then(|| 100.0 * within as f64 / all as f64),
    }
}
