//! Is this stretch of scans a skin at rest? Proof for the tare.

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
}

impl RestStatistics {
    /// Statistics of `taxels` taxels over no scan yet.
    #[must_use]
    pub fn new(taxels: usize) -> Self {
        let _ = taxels;
        Self::default()
    }

    /// Takes one scan; `None` where a taxel gave nothing usable.
    pub fn push(&mut self, scan: impl IntoIterator<Item = Option<f64>>) {
        let _ = scan;
        self.scans += 1;
    }

    /// Scans taken.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.scans
    }

    /// Mean and noise per taxel; NaN where a taxel never gave a value.
    #[must_use]
    pub fn baseline(&self) -> Vec<TaxelBaseline> {
        Vec::new()
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

/// Judges a window of scans against the stored baseline.
#[must_use]
pub fn judge(now: &RestStatistics, reference: Option<&[TaxelBaseline]>, sign: &[i8], limits: &RestLimits) -> RestVerdict {
    let _ = (now, reference, sign, limits);
    RestVerdict::NotEnough {}
}

impl std::fmt::Display for RestVerdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{self:?}")
    }
}
