//! Samples of one taxel, and the least that a fit needs to know of them.
//!
//! Weighted least squares on the mean pressure of each distinct count has the same solution as least squares on all
//! samples, so that a few hundred rows stand for any number of scans without loss.

use crate::dd::Dd;
use crate::options::MAX_MAGNITUDE;

/// The samples of one taxel, all slices of the same length; what is missing at the end of one counts as rejected.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples<'a> {
    /// Counts, or any other real reading.
    pub counts: &'a [f64],
    /// Pressures, kPa.
    pub pressure_kpa: &'a [f64],
}

impl<'a> Samples<'a> {
    /// Samples of these counts and pressures.
    #[must_use]
    pub const fn new(counts: &'a [f64], pressure_kpa: &'a [f64]) -> Self {
        Self { counts, pressure_kpa }
    }
}

/// A row of the least-squares problem, all samples of one count.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// The count.
    pub x: f64,
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
}

/// Reduces samples; sums run over sorted samples, so that their order does not matter.
pub(crate) fn reduce(samples: &Samples<'_>) -> Reduced {
    // Adding zero makes -0 and 0 the same abscissa.
    let good = |value: f64| value.abs() <= MAX_MAGNITUDE;
    let pairs = samples.counts.iter().zip(samples.pressure_kpa);
    let mut list: Vec<(f64, f64)> =
        pairs.filter(|(x, y)| good(**x) && good(**y)).map(|(x, y)| (x + 0.0, y + 0.0)).collect();
    let rejected = (samples.counts.len().max(samples.pressure_kpa.len()) - list.len()) as u64;
    list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let row = |group: &[(f64, f64)]| {
        let n = group.len() as f64;
        let mean = group.iter().fold(Dd::ZERO, |sum, (_, y)| sum + Dd::from(*y)).div_f64(n);
        Row { x: group[0].0, n, y: mean, ss: group.iter().map(|(_, y)| (Dd::from(*y) - mean).hi.powi(2)).sum() }
    };
    Reduced { samples: list.len() as f64, rejected, rows: list.chunk_by(|a, b| a.0 == b.0).map(row).collect() }
}
