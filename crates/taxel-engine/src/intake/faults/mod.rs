//! Faults of taxels and modules, found from their own counts and status words.

pub mod detector;
#[cfg(test)]
mod edge_tests;
pub mod fault;
mod jumps;
pub mod limits;
mod taxel;
#[cfg(test)]
mod tests;

pub use detector::FaultDetector;
pub use fault::{Fault, FaultSet};
pub use limits::FaultLimits;
