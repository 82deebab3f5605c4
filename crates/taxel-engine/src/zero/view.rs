//! The zero and its drift as readers see them.

use taxel_skin::Newton;

use crate::baseline::TaxelBaseline;
use crate::force::reason::ReasonCode;
use crate::statistics::median;

/// How the present zero came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TareView {
    /// One more for each zero taken or lost.
    pub epoch: u64,
    /// Whether live force may rely on it.
    pub valid: bool,
    /// Whether the counts themselves showed rest when it was taken, and nobody had to confirm it.
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

    /// It is not valid; why.
    pub(super) fn invalidate(&mut self, code: ReasonCode, reason: impl Into<String>) {
        (self.valid, self.code, self.reason) = (false, Some(code), reason.into());
    }
}

/// The drift of a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftView {
    /// Median over the modules of how far the zero has followed, counts towards load.
    pub median_counts: f64,
    /// That of the module that drifted furthest, counts.
    pub max_counts: f64,
    /// How much of a load that lies on the whole patch it may have taken for drift.
    pub absorbed: Newton,
}
