//! The zero as readers see it.

use crate::baseline::TaxelBaseline;
use crate::force::reason::ReasonCode;
use crate::statistics::median;
use crate::zero::drift::view::DriftView;

/// How the present zero came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TareView {
    /// One more for each zero taken or lost.
    pub epoch: u64,
    /// Whether live force may rely on it.
    pub valid: bool,
    /// Whether the counts themselves showed rest when it was taken, and nobody had to vouch for it.
    pub at_rest: bool,
    /// When it was taken, nanoseconds since 1970.
    pub wall_ns: i64,
    /// Why it is valid (the rest test's figures, who confirmed) or why it is not any more.
    pub reason: String,
    /// The same for programs, while it is not valid.
    pub code: Option<ReasonCode>,
    /// Median over taxels of the baseline, in counts.
    pub baseline_median: f64,
    /// Median over taxels of the rest noise, standard deviation in counts.
    pub noise_median: f64,
    /// How it follows the temperature.
    pub drift: DriftView,
}

impl TareView {
    /// A zero that was taken, `at_rest` by the counts or by somebody's word.
    #[must_use]
    pub fn taken(epoch: u64, wall_ns: i64, reason: String, at_rest: bool, baseline: &[TaxelBaseline]) -> Self {
        Self {
            epoch,
            valid: true,
            at_rest,
            wall_ns,
            reason,
            code: None,
            baseline_median: median(baseline.iter().map(|t| t.mean)).unwrap_or(f64::NAN),
            noise_median: median(baseline.iter().map(|t| t.noise)).unwrap_or(f64::NAN),
            drift: DriftView::default(),
        }
    }
}
