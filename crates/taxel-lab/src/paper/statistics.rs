//! Means over bins of pressure, and what they say of runs and branches.

use std::ops::Range;

use super::data::Data;
use crate::numbers::{self, mean};

/// Bins over the whole range of pressure: half a kilopascal each for the paper's 70.
const BINS: f64 = 140.0;

/// Mean pressure and mean count of the samples in each bin of equal pressure, as the paper averages them; by bin.
pub(super) struct Binned(Vec<Option<(f64, f64)>>);

impl Binned {
    /// Over the range of `data`.
    pub fn new(data: &Data, samples: impl Iterator<Item = (f64, f64)>) -> Self {
        let (low, high) = data.range_kpa();
        let mut sums = vec![(0.0, 0.0, 0.0); BINS as usize];
        for (kpa, count) in samples {
            let at = ((kpa - low) / (high - low) * BINS).clamp(0.0, BINS - 1.0);
            // A range of nothing has one bin.
            let sum = &mut sums[if at.is_finite() { at as usize } else { 0 }];
            *sum = (sum.0 + 1.0, sum.1 + kpa, sum.2 + count);
        }
        Self(means(sums).collect())
    }

    /// Those bins that have a sample, ascending in pressure.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.0.iter().flatten().copied()
    }
}

/// A taxel's means over one branch.
pub(super) fn branch(data: &Data, taxel: usize, scans: &Range<usize>) -> Binned {
    Binned::new(data, data.samples(taxel, scans.clone(), |_| true))
}

/// The bins in which each of `runs` has samples of a taxel, with the mean pressure and count of each run there.
fn common(data: &Data, taxel: usize, runs: &[&Range<usize>]) -> impl Iterator<Item = Vec<(f64, f64)>> {
    let runs: Vec<Binned> = runs.iter().map(|run| branch(data, taxel, run)).collect();
    (0..BINS as usize).filter_map(move |bin| runs.iter().map(|run| run.0[bin]).collect())
}

/// How far runs lie apart at equal pressure: root mean square over bins and `taxels` of the standard deviation between
/// the first three runs, counts. `None` with a single run.
pub(super) fn repeatability_counts(data: &Data, taxels: &[usize]) -> Option<f64> {
    let runs: Vec<&Range<usize>> = data.branches(true).take(3).collect();
    if runs.len() < 2 {
        return None;
    }
    let variance = |points: Vec<(f64, f64)>| {
        let mean = mean(points.iter().map(|point| point.1));
        points.iter().map(|point| (point.1 - mean).powi(2)).sum::<f64>() / (points.len() - 1) as f64
    };
    let variances = taxels.iter().flat_map(|&taxel| common(data, taxel, &runs).map(variance));
    Some(mean(variances).sqrt()).filter(|counts| counts.is_finite())
}

/// From number and sums to means, `None` of none.
fn means(sums: Vec<(f64, f64, f64)>) -> impl Iterator<Item = Option<(f64, f64)>> {
    sums.into_iter().map(|(n, p, c)| (n > 0.0).then(|| (p / n, c / n)))
}

/// How far the branches of a run lie apart at equal pressure: median over `taxels` of the mean over the bins of the
/// distance, counts. `None` without both branches.
pub(super) fn loop_counts(data: &Data, taxels: &[usize]) -> Option<f64> {
    let (rise, fall) = data.run_with_both()?;
    let width =
        |&taxel: &usize| mean(common(data, taxel, &[rise, fall]).map(|points| (points[0].1 - points[1].1).abs()));
    quantile(taxels.iter().map(width).collect(), 0.5)
}

/// The finite value below which this share of the others lies.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    Some(numbers::quantile(&values, share)).filter(|value| value.is_finite())
}
