//! Whole recordings: the recipe behind `taxel-lab fit` and `taxel-lab apply`.
//!
//! What a file allows and a live stream does not: a fault counts from its onset and not from its discovery
//! ([`Masks`]), counts are averaged over scans before and after ([`smooth()`]), and a tare is taken back if anything later
//! in the file is lighter than its window ([`Zero`]). The rules for faults and rest are those of the live engine.
//!
//! Why each step is there, measured on a real 280-taxel skin (fitted on one recording, judged on two others): broken
//! taxels and flickering modules left in make the error of the force 43 %, a moved zero 5 to 20 %, a tare under load
//! 80 %; plays halve the error on a branch that was not fitted; the order of the polynomial changes 2 %.

pub mod apply;
pub(crate) mod course;
mod dropouts;
#[cfg(test)]
mod edge_tests;
mod gauge_zero;
pub mod judge;
pub mod legs;
pub mod masks;
pub(crate) mod paper;
#[cfg(test)]
mod plays_tests;
pub mod recipe;
pub mod recipe_options;
pub mod scans;
pub(crate) mod skin_fit;
pub mod smooth;
#[cfg(test)]
mod tests;
pub mod zero;

pub use crate::calibration::branch::{Branch, PlaysChoice};
pub use apply::{Applied, ApplyRecipe, Unread, apply};
pub use judge::{Score, judge};
pub use masks::Masks;
pub use recipe::fit;
pub use recipe_options::{FitRecipe, RecordingError};
pub use scans::{RECORDING_SCANS_MIN, Scans};
pub use smooth::{running_median, smooth};
pub use taxel_model::{OneByOne, Workers};
pub use zero::{Tare, Zero};
