//! Mean, noise and drift per taxel over some scans, in one pass.

use std::ops::Range;

use crate::baseline::TaxelBaseline;

/// Least noise, in counts, that a taxel is credited with: rounding alone makes 0.29.
pub(super) const NOISE_FLOOR_COUNTS: f64 = 0.5;

/// A taxel that has moved further from one half of a window to the other has no zero, in standard errors. By chance that
/// becomes of one taxel in a hundred thousand (`a_taxel_at_rest_keeps_its_zero`).
pub(super) const STEADY_ERRORS_MAX: f64 = 5.0;
/// And in counts, so that rounding is no movement.
pub(super) const STEADY_COUNTS_MAX: f64 = 1.0;
/// Half of the scans repeat a conversion of the boards, so half of them count.
pub(super) const INDEPENDENT_SHARE: f64 = 0.5;

/// Standard error of the difference of the means of these, as a factor of the noise.
pub(super) fn error_between(halves: &[RestStatistics; 2]) -> f64 {
    let independent = |half: &RestStatistics| (INDEPENDENT_SHARE * half.scans as f64).max(1.0);
    halves.iter().map(|half| 1.0 / independent(half)).sum::<f64>().sqrt()
}

/// Running mean, variance and drift per taxel over a window of scans.
#[derive(Clone, Debug, Default)]
pub struct RestStatistics {
    scans: u64,
    taxels: Vec<Moments>,
    modules: Vec<Range<usize>>,
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
        Self { scans: 0, taxels: vec![Moments::default(); taxels], modules: Vec::new() }
    }

    /// Says which taxels form a module, so that a load on a part of the skin can be seen.
    #[must_use]
    pub fn in_modules(mut self, modules: impl IntoIterator<Item = Range<usize>>) -> Self {
        self.modules = modules.into_iter().collect();
        self
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
    pub(crate) fn drift(&self) -> Vec<f64> {
        let length = self.scans as f64;
        let of = |m: &Moments| if m.scan_sum_squares > 0.0 { m.cross / m.scan_sum_squares * length } else { 0.0 };
        self.taxels.iter().map(of).collect()
    }

    pub(crate) fn modules(&self) -> &[Range<usize>] {
        &self.modules
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
