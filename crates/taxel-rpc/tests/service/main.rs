//! The service over real sockets, with a test in the engine's place.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

mod attacks;
mod calls;
mod documented;
mod errors;
mod fixture;
mod lists;
mod models;
mod server;
mod sessions;
mod stalls;
mod streams;
mod validations;
