//! The service `taxel.v1` over a handle to the engine: conversions, limits and the policy of streams.
//!
//! Nothing here decides anything about skin. Reads are answered from the engine's newest snapshots; what changes
//! something goes to the engine as a command and is answered with the engine's own words. The engine never waits for a
//! subscriber: a snapshot that nobody has read yet is replaced by the next.

mod access;
mod arrivals;
mod audit;
mod backend;
mod calibration;
mod connection;
mod connections;
mod convert;
mod event_log;
mod events;
mod freshness;
pub mod handle;
mod health;
pub mod limits;
mod listener;
mod model;
mod push;
pub mod push_line;
mod refit;
mod refusals;
mod serve;
mod service;
mod skin;
mod status;
mod stream;
mod tls;
mod validation;

pub use access::origin::{check_certificate_name, group_id};
pub use access::rules::{Access, Grant, Rules, Subject};
pub use access::table::Role;
pub use access::token::Tokens;
pub use backend::{Backend, Told};
pub use connection::Answer;
pub use connections::{Call, Connections, Seat};
pub use convert::force_state;
pub use events::EventFollower;
pub use handle::{BEAT_EVERY, Clock, Handle, Publisher, Request, STALLED_AFTER};
pub use limits::Limits;
pub use listener::Listener;
pub use serve::{Server, SharedServices};
pub use stream::PatchFollower;
pub use tls::{Tls, TlsFiles};
