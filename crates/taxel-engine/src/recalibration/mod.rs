//! Recalibration in service: known loads correct the gain of a model set without the bag.
//!
//! [`Recalibration::of`] takes what the skin read under known loads and says by what factor it is off, how well that is
//! known, and how far a load at a new place may still be off. It refuses what contradicts itself and names the load that
//! does. [`corrected()`] makes a new set of it. Nothing here changes what is in use: an operator activates the new set, or
//! does not.
//!
//! The factor of [`crate::loads`] and this gain describe the same fact, so they never hold at once: the factor is made
//! of loads that were read with the active set, and those of the set before are outdated with the new one.

pub mod assumptions;
pub mod corrected;
pub mod estimate;
pub mod evidence;
pub mod line;
pub mod proposal;
pub mod recording;
pub mod steady;
#[cfg(test)]
mod tests;

pub use assumptions::{Assumptions, PLACE_REL_MAX, PLACE_REL_MIN};
pub use corrected::corrected;
pub use estimate::{JudgedPoint, POINTS_MAX, POINTS_MIN, Recalibration};
pub use evidence::LoadPoint;
pub use proposal::{Chosen, Proposal, propose};
