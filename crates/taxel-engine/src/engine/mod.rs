//! All patches together: the step that everything goes through, commands, and which frame concerns whom.

mod commands;
mod effects;
pub mod pending;
pub mod routes;
pub mod step;

pub use routes::{Route, Routes};
pub use step::Engine;
