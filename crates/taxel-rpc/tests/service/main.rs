//! The service over real sockets, with a test in the engine's place.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

mod attacks;
mod audit;
mod calls;
mod certificates;
mod errors;
mod events;
mod fixture;
mod latency;
mod lists;
mod models;
mod push;
mod reasons;
mod recalibrations;
mod refits;
mod server;
mod sessions;
mod shares;
mod stalls;
mod streams;
mod validations;
mod walk;
