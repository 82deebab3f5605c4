//! Mean, noise and drift per taxel over some scans, in one pass.

use crate::baseline::TaxelBaseline;

/// Half of the scans repeat a conversion of the boards, so half of them count.
pub(super) const INDEPENDENT_SHARE: f64 = 0.5;

/// Running mean, variance and drift per taxel over a window of scans.
#[derive(Clone, Debug, Default)]
pub struct RestStatistics {
    scans: u64,
    taxels: Vec<Moments>,
}

/// Welford's recurrences, also for the covariance with the number of the scan.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    n: f64,
    mean: f64,
    sum_squares: f64,
    scan_mean: f64,
    scan_sum_squares: f64,
    cross: f64,
}

impl RestStatistics {
    /// Statistics of `taxels` taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self { scans: 0, taxels: vec![Moments::default(); taxels] }
    }

    /// Takes one scan; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, scan: impl IntoIterator<Item = Option<f64>>) {
        let number = self.scans as f64;
        self.scans += 1;
        for (moments, count) in self.taxels.iter_mut().zip(scan) {
            let Some(count) = count.filter(|c| c.is_finite()) else { continue };
            moments.push(number, count);
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
        let of = |m: &Moments| match m.n {
            n if n == 0.0 || n < least => TaxelBaseline::UNKNOWN,
            n if n >= 2.0 => TaxelBaseline { mean: m.mean, noise: (m.sum_squares / (n - 1.0)).sqrt() },
            _ => TaxelBaseline { mean: m.mean, noise: 0.0 },
        };
        self.taxels.iter().map(of).collect()
    }

    /// Least-squares drift per taxel from the first to the last scan, in counts; 0 where it cannot be known.
    pub(super) fn drift(&self) -> Vec<f64> {
        let length = self.scans as f64;
        let of = |m: &Moments| if m.scan_sum_squares > 0.0 { m.cross / m.scan_sum_squares * length } else { 0.0 };
        self.taxels.iter().map(of).collect()
    }

    /// Standard error of the difference of the means of these two, as a factor of the noise.
    pub(super) fn error_between(halves: &[Self; 2]) -> f64 {
        let independent = |half: &Self| (INDEPENDENT_SHARE * half.scans as f64).max(1.0);
        halves.iter().map(|half| 1.0 / independent(half)).sum::<f64>().sqrt()
    }
}

impl Moments {
    fn push(&mut self, scan: f64, count: f64) {
        self.n += 1.0;
        let (ahead, later) = (count - self.mean, scan - self.scan_mean);
        self.mean += ahead / self.n;
        self.scan_mean += later / self.n;
        self.sum_squares += ahead * (count - self.mean);
        self.scan_sum_squares += later * (scan - self.scan_mean);
        self.cross += later * (count - self.mean);
    }
}
