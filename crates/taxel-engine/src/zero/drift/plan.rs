//! Whether and how far the zero follows the temperature.

/// Whether and how far the zero follows the temperature of the skin; see [`crate::zero::drift`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftPlan {
    /// Whether it does at all.
    pub follow: bool,
    /// How far at most from the proven zero, counts.
    pub bound_counts: f64,
}

impl Default for DriftPlan {
    fn default() -> Self {
        Self { follow: false, bound_counts: 3.0 }
    }
}
