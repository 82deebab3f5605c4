//! The whole boundary between the engine and the world: what goes in, what comes out, what readers see.

pub mod audit;
pub mod catalogue;
pub mod command;
pub mod events;
mod fault_events;
pub mod input;
pub mod output;
pub mod pushed;
pub mod record;
pub mod snapshot;
