//! Compares the pressures read with those of the gauge.

use crate::calibration::fit::apply::{Applied, Column};
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
    /// Share of the readings within 1.96 standard deviations of the gauge, in percent, of those whose deviation is known; `None`
    /// without any.
    pub coverage_percent: Option<f64>,
    /// The same of the readings beyond the calibrated range.
    pub coverage_beyond_percent: Option<f64>,
    /// How many readings those are, in percent of all with a known deviation.
    pub beyond_percent: f64,
}

/// Judges `applied` against the gauge, kPa, one value per scan.
#[must_use]
pub fn judge(applied: &Applied, gauge_kpa: &[f64]) -> Score {
    let columns: Vec<&Column> = applied.columns.iter().flatten().collect();
    let area = |i: usize| mean(columns.iter().map(|column| column.kpa[i])).0 - gauge_kpa[i];
    let high = || (0..gauge_kpa.len()).filter(|&i| gauge_kpa[i] > RELATIVE_ABOVE_KPA);
    let errors: Vec<f64> =
        columns.iter().map(|c| root_mean_square(c.kpa.iter().zip(gauge_kpa).map(|(read, p)| read - p))).collect();
    let (mut inside, mut beyond) = (Tally::default(), Tally::default());
    for column in &columns {
        for (((read, sigma), p), is_beyond) in
            column.kpa.iter().zip(&column.sigma_kpa).zip(gauge_kpa).zip(&column.beyond)
        {
            if *is_beyond { beyond.add(read - p, *sigma) } else { inside.add(read - p, *sigma) }
        }
    }
    let both = Tally { within: inside.within + beyond.within, all: inside.all + beyond.all };
    Score {
        area_percent: 100.0 * mean(high().map(|i| area(i).abs() / gauge_kpa[i])).0,
        bias_kpa: mean(high().map(area)).0,
        taxel_rmse_kpa: mean(errors.iter().copied()).0,
        taxel_rmse_median_kpa: quantile(errors, 0.5).unwrap_or(f64::NAN),
        taxels: columns.len(),
        coverage_percent: both.percent(),
        coverage_beyond_percent: beyond.percent(),
        beyond_percent: 100.0 * beyond.all as f64 / both.all.max(1) as f64,
    }
}

/// Errors within the 95 % interval, and all of them.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    within: u64,
    all: u64,
}

impl Tally {
    /// A reading of which nobody knows how far off it may be says nothing of the interval.
    fn add(&mut self, error: f64, sigma: f64) {
        if error.is_finite() && sigma.is_finite() {
            self.all += 1;
            self.within += u64::from(error.abs() <= WITHIN_95 * sigma);
        }
    }

    fn percent(self) -> Option<f64> {
        (self.all > 0).then(|| 100.0 * self.within as f64 / self.all as f64)
    }
}
