//! Recalibration in service: known loads correct the gain of a model set without the bag.
//!
//! [`Recalibration::of`] takes what the skin read under known loads and says by what factor it is off, how well that is
//! known, and how far a load at a new place may still be off. It refuses what contradicts itself and names the load that
//! does. [`corrected()`] makes a new set of it. Nothing here changes what is in use: an operator activates the new set, or
//! does not.

pub mod estimate;
pub mod line;
pub mod points;
pub mod proposal;
#[cfg(test)]
mod tests;

pub use estimate::{JudgedPoint, POINTS_MAX, POINTS_MIN, Recalibration};
pub use points::{Assumptions, LoadPoint, PLACE_REL, PLACE_REL_MAX, PLACE_REL_MIN};
pub use proposal::{Chosen, Proposal, corrected, propose};
