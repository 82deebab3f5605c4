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
mod message;
mod pairing;

pub use command::{BoardConfig, Command, TriangleConfig};
pub use message::{FirmwareVersion, Message, Refusal, StatusWord, decode};
pub use pairing::{Duplicates, ModuleScan, Orphans, Pairer};

use crate::CanId;

/// Message class, bits 10 to 8 of the identifier.
mod class {
    /// Polling analog: commands to skin boards and their replies.
    pub const POLLING_ANALOG: u16 = 2;
    /// Periodic analog: thermometers, and skin data of boards in their legacy mode.
    pub const PERIODIC_ANALOG: u16 = 3;
    /// Periodic skin: skin data.
    pub const PERIODIC_SKIN: u16 = 4;
    /// Battery; one firmware build sends its skin tails here.
    pub const BATTERY: u16 = 6;
    /// Bootloader and management; the overflow notice.
    pub const MANAGEMENT: u16 = 7;
}

/// The command byte that asks for the firmware version, and begins the reply.
const FIRMWARE_VERSION: u8 = 0x1C;

/// `class << 8 | high << 4 | low`, the layout of every identifier.
const fn identifier(class: u16, high: u8, low: u8) -> CanId {
    CanId::Standard((class & 7) << 8 | (high as u16 & 0xF) << 4 | (low as u16 & 0xF))
}

/// Class, high nibble and low nibble of a standard identifier; `None` for an extended one.
///
/// What has more than 11 bits gets a class above 7, which means nothing to any decoder.
const fn split(id: CanId) -> Option<(u16, u8, u8)> {
    match id {
        CanId::Standard(id) => Some((id >> 8, (id >> 4 & 0xF) as u8, (id & 0xF) as u8)),
        CanId::Extended(_) => None,
    }
}

#[cfg(test)]
mod tests;
