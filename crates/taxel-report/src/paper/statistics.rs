//! Means over bins of pressure, and what they say of runs and branches.

use std::ops::Range;

use crate::numbers::{self, mean};
use crate::paper::data::Data;

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
        Self(sums.into_iter().map(|(n, p, c)| (n > 0.0).then(|| (p / n, c / n))).collect())
    }

    /// Those bins that have a sample, ascending in pressure.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.0.iter().flatten().copied()
    }

    fn count(&self, bin: usize) -> Option<f64> {
        self.0.get(bin).copied().flatten().map(|point| point.1)
    }
}

/// A taxel's means over one branch.
pub(super) fn branch(data: &Data, taxel: usize, scans: &Range<usize>) -> Binned {
    Binned::new(data, data.samples(taxel, scans.clone(), |_| true))
}

/// How far runs lie apart at equal pressure: root mean square over bins and `taxels` of the standard deviation between
/// the first three runs, counts. `None` with a single run.
pub(super) fn repeatability_counts(data: &Data, taxels: &[usize]) -> Option<f64> {
    let runs: Vec<&Range<usize>> = data.branches(true).take(3).collect();
    if runs.len() < 2 {
        return None;
    }
    let mut squares = Vec::new();
    for &taxel in taxels {
        let runs: Vec<Binned> = runs.iter().map(|run| branch(data, taxel, run)).collect();
        for bin in 0..BINS as usize {
            let Some(counts) = runs.iter().map(|run| run.count(bin)).collect::<Option<Vec<f64>>>() else { continue };
            let mean = mean(counts.iter().copied());
            squares.push(counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (counts.len() - 1) as f64);
        }
    }
    Some(mean(squares.into_iter()).sqrt()).filter(|counts| counts.is_finite())
}

/// What each of `runs` lies apart from their mean at equal pressure: by bin, kPa and counts, mean over `taxels`.
pub(super) fn differences(data: &Data, taxels: &[usize], runs: &[&Range<usize>]) -> Vec<Vec<(f64, f64)>> {
    let mut sums = vec![vec![(0.0, 0.0, 0.0); BINS as usize]; runs.len()];
    for &taxel in taxels {
        let runs: Vec<Binned> = runs.iter().map(|run| branch(data, taxel, run)).collect();
        for bin in 0..BINS as usize {
            let Some(points) = runs.iter().map(|run| run.0[bin]).collect::<Option<Vec<(f64, f64)>>>() else { continue };
            let middle = mean(points.iter().map(|point| point.1));
            for (run, (kpa, count)) in sums.iter_mut().zip(points) {
                let sum = &mut run[bin];
                *sum = (sum.0 + 1.0, sum.1 + kpa, sum.2 + count - middle);
            }
        }
    }
    let line = |run: Vec<(f64, f64, f64)>| {
        run.into_iter().filter(|sum| sum.0 > 0.0).map(|(n, kpa, count)| (kpa / n, count / n)).collect()
    };
    sums.into_iter().map(line).collect()
}

/// How far the branches of a run lie apart at equal pressure: median over `taxels` of the mean over the bins of the
/// distance, counts. `None` without both branches.
pub(super) fn loop_counts(data: &Data, taxels: &[usize]) -> Option<f64> {
    let (rise, fall) = data.run_with_both()?;
    let width = |&taxel: &usize| {
        let (rise, fall) = (branch(data, taxel, rise), branch(data, taxel, fall));
        mean((0..BINS as usize).filter_map(|bin| Some((rise.count(bin)? - fall.count(bin)?).abs())))
    };
    quantile(taxels.iter().map(width).collect(), 0.5)
}

/// The finite value below which this share of the others lies.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    Some(numbers::quantile(&values, share)).filter(|value| value.is_finite())
}
