//! The whole daemon as a process on the simulated bus: how long a value takes to a client, and what a scene costs.

mod binary;
mod client;
mod engine_time;
mod figures;
mod latency;
mod process;
mod rig;
mod scenes;
mod ten_buses;
mod wire_floor;

pub use latency::latency;
pub use scenes::scenes;
