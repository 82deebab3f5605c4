//! The service `taxel.v1` over a handle to the engine: conversions, limits and the policy of streams.
//!
//! Nothing here decides anything about skin. Reads are answered from the engine's newest snapshots; what changes
//! something goes to the engine as a command and is answered with the engine's own words. The engine never waits for a
//! subscriber: a snapshot that nobody has read yet is replaced by the next.

mod about;
mod access;
mod answers;
mod arrivals;
mod aside;
mod audit;
mod audit_words;
mod calibration;
mod clock;
mod codec;
mod convert;
mod event_log;
mod events;
mod export;
mod follow;
mod force;
mod freshness;
mod guard;
pub mod handle;
mod health;
mod heartbeat;
pub mod limits;
mod listener;
mod model;
mod paced;
mod page;
mod push;
pub mod push_line;
mod reasons;
mod recalibration;
mod refit;
mod refusals;
mod request_body;
mod samples;
mod serve;
mod service;
mod shared;
mod shares;
mod skin;
mod stall;
mod status;
mod stored_sets;
mod stream;
#[cfg(feature = "tls")]
mod tls;
mod turns;
mod unproven;
mod validation;
mod watchdog;

pub use access::accounts::{group_id, user_id};
pub use access::certificate_name::CertificateName;
pub use access::private_file::read_private;
pub use access::role::Role;
pub use access::rules::{Access, Grant, Rules, Subject};
pub use access::token::Tokens;
pub use clock::{Clock, Clocks};
pub use codec::ModelCodec;
pub use follow::{EventFollower, PatchFollower};
pub use handle::{AuditSource, Handle, OnEntries, OnSamples, Publisher, RecordingSource, Request, Room, SamplesSource};
pub use heartbeat::{BEAT_EVERY, STALLED_AFTER};
pub use limits::{Limits, Rate};
pub use listener::Listener;
pub use serve::{Drain, ServeError, serve, serve_and_share};
pub use shared::SharedServices;
pub use stored_sets::{ModelSetSource, OnModelSet};
#[cfg(feature = "tls")]
pub use tls::{Tls, TlsError, TlsFiles};
