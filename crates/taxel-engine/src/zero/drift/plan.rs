//! Whether and how far the zero follows the temperature.

/// Whether and how far the zero follows the temperature of the skin; see [`crate::zero::drift`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftPlan {
    /// Whether it does at all.
    pub follow: bool,
    /// How fast at most, counts per minute.
    pub rate_max_counts_per_min: f64,
    /// How far at most from the proven zero, counts.
    pub bound_counts: f64,
}

impl Default for DriftPlan {
    fn default() -> Self {
        Self { follow: false, rate_max_counts_per_min: 1.0, bound_counts: 3.0 }
    }
}
