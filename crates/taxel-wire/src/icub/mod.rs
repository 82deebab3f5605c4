//! The skin protocol of iCub's boards (MTB, MTB4 and their kin): classic CAN 2.0A, 11-bit identifiers, 1 Mbit/s.
//!
//! | bits of the identifier | classes 0, 2, 7 (commands) | classes 1, 3, 4, 5, 6 (streams) |
//! |---|---|---|
//! | 10..8 | class | class |
//! | 7..4 | source, 0 is the host | source board |
//! | 3..0 | destination | message type; for skin the module, 0 to 15 |
//!
//! The protocol has no counter, no time stamp and no checksum of its own: loss shows only as a missing half or a
//! late cycle, and what is decoded is plausible, not authentic.

mod command;
mod identifier;
mod message;
mod pairing;

pub use command::{BoardConfig, Command, TriangleConfig};
pub use message::{FirmwareVersion, Message, Refusal, StatusWord, decode};
pub use pairing::{Duplicates, ModuleScan, Orphans, Pairer};

#[cfg(test)]
mod tests;
