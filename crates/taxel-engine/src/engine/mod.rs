//! All patches together: the step that everything goes through, commands, and which frame concerns whom.

mod activations;
mod answer;
mod commands;
mod deletions;
mod effects;
mod known_sets;
pub mod limits;
pub mod pending;
mod plausible;
mod pushed;
mod recalibrations;
mod refits;
pub mod routes;
mod sessions;
mod shared;
pub mod step;
#[cfg(test)]
mod step_tests;
mod successors;

pub use routes::{Route, Routes};
pub use step::Engine;
