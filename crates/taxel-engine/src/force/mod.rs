//! From counts to a force: the models at the present zero, which taxels count, what is touched, and how far to trust it.

pub mod budget;
pub mod contacts;
mod coverage;
pub mod evaluator;
#[cfg(test)]
mod history_tests;
pub mod hysteresis;
mod light_end;
pub mod measure;
pub mod neighbours;
pub mod offsets;
pub mod owner;
pub mod reason;
pub mod remainder;
pub mod sample;
pub mod sampling;
mod source;
pub mod tables;
pub mod taxels;
#[cfg(test)]
pub(crate) mod tests;

pub use crate::baseline::Activation;
pub use budget::{Budget, Term};
pub use evaluator::Evaluator;
pub use measure::{ForceModel, Layout, Outputs};
pub use owner::{Force, ForcePlan};
pub use reason::{Reason, ReasonCode};
pub use sample::{Contact, ForceSample, ForceState, RangeFlag, TaxelState, Undetected};
pub use tables::{Tables, TaxelReading};
pub use taxels::{Basis, ModuleAge, Taxels};
