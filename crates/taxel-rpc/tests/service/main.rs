//! The service over real sockets, with a test in the engine's place.

mod attacks;
mod calls;
mod documented;
mod errors;
mod fixture;
mod lists;
mod server;
mod sessions;
mod streams;
