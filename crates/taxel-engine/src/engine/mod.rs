//! All patches together: the step that everything goes through, commands, and which frame concerns whom.

mod commands;
mod effects;
pub mod pending;
mod plausible;
mod pushed;
pub mod routes;
mod sessions;
mod sets;
mod shared;
pub mod step;
#[cfg(test)]
mod step_tests;

pub use routes::{Route, Routes};
pub use step::Engine;
