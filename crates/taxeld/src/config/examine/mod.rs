//! Everything that is wrong with a configuration, in one run.

mod expected;
mod feasible;
mod problem;
pub mod run;
mod tree;

pub use problem::Problems;
pub use run::{examine, examine_text, examine_with, read_text};
