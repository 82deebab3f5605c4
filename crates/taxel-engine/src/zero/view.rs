//! The zero as readers see it.

use crate::zero::drift::view::DriftView;

/// How the present zero came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TareView {
    /// One more for each zero taken or lost.
    pub epoch: u64,
    /// Whether live force may rely on it.
    pub valid: bool,
    /// When it was taken, nanoseconds since 1970.
    pub wall_ns: i64,
    /// Why it is valid (the rest test's figures, who confirmed) or why it is not any more.
    pub reason: String,
    /// Median over taxels of the baseline, in counts.
    pub baseline_median: f64,
    /// Median over taxels of the rest noise, standard deviation in counts.
    pub noise_median: f64,
    /// How it follows the temperature.
    pub drift: DriftView,
}
