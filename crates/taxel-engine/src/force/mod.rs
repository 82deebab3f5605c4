//! From counts to a force: the models at the present zero, which taxels count, what is touched, and how far to trust it.

pub(crate) mod budget;
pub(crate) mod contacts;
mod coverage;
mod dead_zone;
mod discs;
pub(crate) mod evaluator;
mod fill;
#[cfg(test)]
mod history_tests;
pub(crate) mod hysteresis;
mod light_end;
pub(crate) mod measure;
pub(crate) mod neighbours;
pub(crate) mod offsets;
pub(crate) mod owner;
mod place;
pub(crate) mod reason;
pub(crate) mod sample;
pub(crate) mod sampling;
mod source;
pub(crate) mod tables;
pub(crate) mod taxels;
#[cfg(test)]
pub(crate) mod tests;
mod unloading;
pub(crate) mod untouched;

pub use crate::baseline::Activation;
pub use evaluator::Evaluator;
pub use measure::{Layout, Outputs};
pub use owner::{Force, ForcePlan, ZeroState};
