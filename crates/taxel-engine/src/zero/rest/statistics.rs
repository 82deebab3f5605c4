//! Mean and noise per taxel over some scans, in one pass.

use crate::baseline::TaxelBaseline;

/// Half of the scans repeat a conversion of the boards, so half of them count.
const INDEPENDENT_SHARE: f64 = 0.5;

/// Running mean and variance per taxel over a window of scans.
#[derive(Clone, Debug, Default)]
pub struct RestStatistics {
    scans: u64,
    taxels: Vec<Sums>,
}

/// Sums of how far values lie from the first: exactly no noise for a taxel that always reads the same.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: f64,
    first: f64,
    sum: f64,
    squares: f64,
}

impl RestStatistics {
    /// Statistics of `taxels` taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self { scans: 0, taxels: vec![Sums::default(); taxels] }
    }

    /// Begins anew.
    pub(in crate::zero) fn restart(&mut self) {
        self.scans = 0;
        self.taxels.fill(Sums::default());
    }

    /// Takes one scan; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, scan: impl IntoIterator<Item = Option<f64>>) {
        self.scans += 1;
        for (sums, count) in self.taxels.iter_mut().zip(scan) {
            let Some(count) = count.filter(|c| c.is_finite()) else { continue };
            if sums.n == 0.0 {
                sums.first = count;
            }
            let away = count - sums.first;
            sums.n += 1.0;
            sums.sum += away;
            sums.squares += away * away;
        }
    }

    /// Scans taken.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.scans
    }

    /// Mean and noise per taxel; NaN where a taxel gave a value in less than half of the scans: what it read in its
    /// sound moments is no zero for the rest of them.
    #[must_use]
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        let least = 0.5 * self.scans as f64;
        let of = |&Sums { n, first, sum, squares }: &Sums| {
            if n == 0.0 || n < least {
                return TaxelBaseline::UNKNOWN;
            }
            let variance = (squares - sum * sum / n).max(0.0) / (n - 1.0).max(1.0);
            TaxelBaseline { mean: first + sum / n, noise: variance.sqrt() }
        };
        self.taxels.iter().map(of).collect()
    }

    /// Standard error of the difference of the means of these two, as a factor of the noise.
    pub(super) fn error_between(halves: &[Self; 2]) -> f64 {
        let independent = |half: &Self| (INDEPENDENT_SHARE * half.scans as f64).max(1.0);
        halves.iter().map(|half| 1.0 / independent(half)).sum::<f64>().sqrt()
    }
}
