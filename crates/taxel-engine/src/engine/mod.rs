//! All patches together: the step that everything goes through, commands, and which frame concerns whom.

mod answer;
mod commands;
mod deletions;
mod effects;
pub mod limits;
pub mod pending;
pub mod routes;
mod sessions;
pub mod step;

pub use routes::{Route, Routes};
pub use step::Engine;
