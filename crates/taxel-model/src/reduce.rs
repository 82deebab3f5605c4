//! The least that a fit needs to know of the samples.
//!
//! Weighted least squares on the mean pressure of each distinct count has the same solution as least squares on all
//! samples, so that a few hundred rows stand for any number of scans without loss.

use crate::dd::Dd;

/// A row of the least-squares problem, all samples of one count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// The count.
    pub x: Dd,
    /// How many samples.
    pub n: f64,
    /// Their mean pressure, kPa.
    pub y: Dd,
    /// Sum of squares about it, kPa^2.
    pub ss: f64,
}

/// Samples reduced.
#[derive(Clone, Debug)]
pub(crate) struct Reduced {
    /// Number of samples behind the rows.
    pub samples: f64,
    /// Ascending in count.
    pub rows: Vec<Row>,
    /// Samples that were not finite or out of range.
    pub rejected: u64,
    /// Every count is an integer.
    pub integer: bool,
}

impl Reduced {
    /// Standard deviation of the pressure and the range of its means, kPa.
    pub fn pressure_spread(&self) -> Spread {
        let n = self.samples.max(1.0);
        let mean = self.rows.iter().map(|r| r.n * r.y.hi).sum::<f64>() / n;
        let ss: f64 = self.rows.iter().map(|r| r.ss + r.n * (r.y.hi - mean).powi(2)).sum();
        let means = self.rows.iter().map(|r| r.y.hi);
        let (low, high) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), y| (lo.min(y), hi.max(y)));
        Spread { sd_kpa: (ss / n).sqrt(), range_kpa: (high - low).max(0.0) }
    }
}

/// How the pressures are spread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub sd_kpa: f64,
    pub range_kpa: f64,
}
