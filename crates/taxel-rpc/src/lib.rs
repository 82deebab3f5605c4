//! The service `taxel.v1` over a handle to the engine: conversions, limits and the policy of streams.
//!
//! Nothing here decides anything about skin. Reads are answered from the engine's newest snapshots; what changes
//! something goes to the engine as a command and is answered with the engine's own words. The engine never waits for a
//! subscriber: a snapshot that nobody has read yet is replaced by the next.

mod calibration;
mod clock;
mod convert;
mod force;
mod freshness;
mod guard;
pub mod handle;
mod health;
mod heartbeat;
pub mod limits;
mod model;
mod page;
mod serve;
mod service;
mod skin;
mod status;
mod stream;
mod validation;
mod watchdog;

pub use clock::{Clock, Clocks};
pub use handle::{Handle, ModelCodec, Publisher, Request};
pub use heartbeat::{BEAT_EVERY, STALLED_AFTER};
pub use limits::Limits;
pub use serve::{Drain, Listener, ServeError, serve};
