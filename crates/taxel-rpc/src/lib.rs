//! The service `taxel.v1` over a handle to the engine: conversions, limits and the policy of streams.
//!
//! Nothing here decides anything about skin. Reads are answered from the engine's newest snapshots; what changes
//! something goes to the engine as a command and is answered with the engine's own words. The engine never waits for a
//! subscriber: a snapshot that nobody has read yet is replaced by the next.

mod about;
mod access;
mod answer;
mod arrivals;
mod audit;
mod backend;
mod calibration;
mod clock;
mod connection;
mod connections;
mod convert;
mod event_log;
mod events;
mod export;
mod follow;
mod force;
mod freshness;
pub mod handle;
mod health;
mod heartbeat;
pub mod limits;
mod listener;
mod model;
mod page;
mod push;
pub mod push_line;
mod reasons;
mod recalibration;
mod refit;
mod refusals;
mod said;
mod serve;
mod service;
mod shares;
mod skin;
mod status;
mod stream;
mod tls;
mod validation;
mod watchdog;

pub use access::accounts::{group_id, user_id};
pub use access::origin::check_certificate_name;
pub use access::role::Role;
pub use access::rules::{Access, Grant, Rules, Subject};
pub use access::token::Tokens;
pub use answer::Answer;
pub use backend::{Backend, Told};
pub use clock::Clock;
pub use connections::{Call, Connections, Seat};
pub use convert::force_state;
pub use events::EventFollower;
pub use follow::PatchFollower;
pub use handle::{Handle, Publisher, Request};
pub use heartbeat::{BEAT_EVERY, STALLED_AFTER};
pub use limits::Limits;
pub use listener::Listener;
pub use serve::{Drain, ServeError, Server, SharedServices};
pub use tls::{Tls, TlsFiles};
