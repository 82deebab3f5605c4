//! The whole daemon as a process on the simulated bus: how long a value takes to a client, and what a scene costs.

pub mod client;
mod latency;
pub mod process;
mod scenes;
mod wire_floor;

pub use latency::latency;
pub use scenes::scenes;
