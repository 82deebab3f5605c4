//! The one owner of live state: frames and commands go in, snapshots, records and frames to send come out.
//!
//! No I/O, no clock, no runtime: [`Now`] is part of every call, so that the live bus, a log replay and the simulator
//! run the very same engine, and a replay gives bit-identical results every time.

pub mod boards;
pub mod bring_up;
pub mod command;
mod commands;
pub mod compensate;
pub mod contact;
pub mod drift;
mod engine;
pub mod evaluate;
pub mod faults;
pub mod force;
pub mod gauge;
mod health;
pub mod io;
pub mod live;
pub mod model_set;
pub mod neighbours;
mod patch;
pub mod plan;
mod procedure;
mod publish;
pub mod record;
pub mod recording;
pub mod rest;
pub mod route;
pub mod session;
pub mod snapshot;
pub mod tables;
pub mod tare;
pub mod taxels;
pub mod validation;
mod zero;

pub use engine::Engine;
pub use io::{BusNotice, Input, Now, Output, Restored};
