//! Limits that several parts of the drift share.

/// Most counts that a taxel can move per count of a pad: the boards compensate a part of its drift, never add to it.
pub(super) const COEFFICIENT_MAX: f64 = 1.25;
/// Common mode that is believed without the pads, in counts: half of what they can be told apart by.
pub(super) const UNEXPLAINED_COUNTS: f64 = 0.5;
/// A module learns its coefficient while it is so close to what the others explain, in counts.
pub(super) const AGREEMENT_COUNTS: f64 = 0.5;
/// So long after a touch a module is not followed: fabric creeps back within some ten seconds.
pub(super) const HOLD_OFF_S: f64 = 30.0;
/// Uncertainty of a coefficient that is not known: the boards leave a quarter to all of the drift.
pub(super) const COEFFICIENT_SIGMA: f64 = 0.5;
