//! Whole recordings: the recipe behind `taxel-lab fit` and `taxel-lab apply`.
//!
//! What a file allows and a live stream does not: a fault counts from its onset and not from its discovery
//! (`masks.rs`), counts are averaged over scans before and after (`smooth.rs`), and a tare is taken back if anything later
//! in the file is lighter than its window (`zero.rs`). The rules for faults and rest are those of the live engine.
//!
//! Why each step is there, measured on a real 280-taxel skin (fitted on one recording, judged on two others): broken
//! taxels and flickering modules left in make the error of the force 43 %, a moved zero 5 to 20 %, a tare under load
//! 80 %; plays halve the error on a branch that was not fitted; the order of the polynomial changes 2 %.

pub(crate) mod apply;
pub(crate) mod course;
mod dropouts;
#[cfg(test)]
mod edge_tests;
mod gauge_zero;
pub(crate) mod judge;
pub mod legs;
pub(crate) mod masks;
#[cfg(test)]
mod plays_tests;
pub(crate) mod recipe;
pub(crate) mod recipe_options;
pub mod scans;
pub(crate) mod skin_fit;
pub(crate) mod smooth;
#[cfg(test)]
mod tests;
pub(crate) mod zero;

pub use crate::calibration::branch::Branch;
pub use apply::{Applied, Column, apply};
pub use judge::{Score, judge};
pub use recipe::fit;
pub use recipe_options::{FitRecipe, RecordingError};
pub use scans::{RECORDING_SCANS_MIN, Scans};
pub use taxel_model::{OneByOne, Workers};
pub use zero::Tare;

#[cfg(test)]
use self::{masks::Masks, smooth::running_median, smooth::smooth, zero::Zero};
