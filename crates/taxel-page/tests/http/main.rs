//! The page's server over real sockets, with a test in the engine's place.

#![allow(clippy::unwrap_used, clippy::panic)] // clippy exempts only functions that are tests themselves

mod calls;
mod fixture;
mod hostile;
mod metrics;
mod streams;
