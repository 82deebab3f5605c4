//! Samples of one taxel as slices, their reduction to rows of a least-squares problem, and its fit.

use crate::dd::Dd;
use crate::fit::fit_reduced;
use crate::model::TaxelModel;
use crate::options::{FitOptions, MAX_MAGNITUDE};
use crate::reduce::{Reduced, Row};

/// The samples of one taxel, all slices of the same length; what is missing at the end of one counts as rejected.
#[derive(Clone, Copy, Debug, Default)]
pub struct Samples<'a> {
    /// Counts, or any other real reading.
    pub counts: &'a [f64],
    /// What the decimals as written leave over of `counts`: a decimal is rarely an f64.
    pub counts_low: Option<&'a [f64]>,
    /// Pressures, kPa.
    pub pressure_kpa: &'a [f64],
    /// What the decimals as written leave over of `pressure_kpa`.
    pub pressure_low: Option<&'a [f64]>,
}

impl<'a> Samples<'a> {
    /// Samples without low parts.
    #[must_use]
    pub const fn new(counts: &'a [f64], pressure_kpa: &'a [f64]) -> Self {
        Self { counts, counts_low: None, pressure_kpa, pressure_low: None }
    }
}

#[derive(Clone, Copy)]
struct Sample {
    x: Dd,
    y: Dd,
}

fn low(parts: Option<&[f64]>, i: usize) -> f64 {
    parts.and_then(|parts| parts.get(i)).copied().filter(|low| low.is_finite()).unwrap_or(0.0)
}

/// The valid samples and the number of those that are not.
fn valid(samples: &Samples<'_>) -> (Vec<Sample>, u64) {
    let n = samples.counts.len().max(samples.pressure_kpa.len());
    let good = |v: f64| v.abs() <= MAX_MAGNITUDE;
    let list: Vec<Sample> = samples
        .counts
        .iter()
        .zip(samples.pressure_kpa)
        .enumerate()
        .filter(|(_, (x, y))| good(**x) && good(**y))
        .map(|(i, (&x, &y))| Sample {
            // Adding zero makes -0 and 0 the same abscissa.
            x: Dd { hi: x + 0.0, lo: low(samples.counts_low, i) },
            y: Dd { hi: y + 0.0, lo: low(samples.pressure_low, i) },
        })
        .collect();
    let rejected = (n - list.len()) as u64;
    (list, rejected)
}

/// Fits the paper's polynomial of one taxel: the sum of (P - P(C))^2 over all samples. The curve is as it comes out over all
/// counts that were seen, monotone or not. Never panics: [`TaxelModel::status`] says why there is no usable curve.
#[must_use]
pub fn fit(samples: &Samples<'_>, options: &FitOptions) -> TaxelModel {
    fit_reduced(&reduce(samples), options)
}

/// Reduces samples; sums run over sorted samples, so that their order does not matter.
fn reduce(samples: &Samples<'_>) -> Reduced {
    let (mut list, rejected) = valid(samples);
    let integer = list.iter().all(|s| s.x.hi.fract() == 0.0 && s.x.lo == 0.0);
    list.sort_unstable_by(|a, b| order(a.x, b.x).then(order(a.y, b.y)));
    Reduced { samples: list.len() as f64, rows: rows(&list), rejected, integer }
}

fn order(a: Dd, b: Dd) -> std::cmp::Ordering {
    a.hi.total_cmp(&b.hi).then(a.lo.total_cmp(&b.lo))
}

/// Means and scatter of the pressures at equal counts; `list` is sorted by count.
fn rows(list: &[Sample]) -> Vec<Row> {
    list.chunk_by(|a, b| a.x == b.x)
        .map(|group| {
            let n = group.len() as f64;
            let mean = group.iter().fold(Dd::ZERO, |sum, s| sum + s.y).div_f64(n);
            let ss = group.iter().map(|s| (s.y - mean).hi.powi(2)).sum();
            Row { x: group[0].x, n, y: mean, ss }
        })
        .collect()
}
