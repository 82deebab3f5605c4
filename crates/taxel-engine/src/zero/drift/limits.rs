//! Limits that several parts of the drift share.

use taxel_skin::Newton;

/// Most counts that a taxel can move per count of a pad: the boards compensate a part of its drift, never add to it.
pub(super) const COEFFICIENT_MAX: f64 = 1.25;
/// Common mode that is believed without the pads, in counts: half of what they can be told apart by.
pub(super) const UNEXPLAINED_COUNTS: f64 = 0.5;
/// Most of what the pads do not explain that may be taken from a load that lies on the whole patch. Half of the lightest
/// mass that skins are weighed with, and on the forearm's 230 taxels an eighth of a count: what the medians of the modules
/// still tell from noise, and what a tenth to a fifth of a count of the pads, their own noise, would explain.
pub(super) const ABSORBED_MAX: Newton = Newton(1.0);
/// A module learns its coefficient while it is so close to what the others explain, in counts.
pub(super) const AGREEMENT_COUNTS: f64 = 0.5;
/// So long after a touch a module is not followed: fabric creeps back within some ten seconds.
pub(super) const HOLD_OFF_S: f64 = 30.0;
/// How far the coefficient of one module lies from that of the patch, standard deviation: the boards leave a quarter to all of
/// the drift.
pub(super) const BETWEEN_MODULES: f64 = 0.25;
