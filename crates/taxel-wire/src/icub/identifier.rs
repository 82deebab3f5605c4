//! The layout of every identifier: bits 10 to 8 are the class, the meaning of the others depends on it.

use crate::frame::CanId;

/// Message class, bits 10 to 8 of the identifier.
pub(super) mod class {
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

/// `class << 8 | high << 4 | low`, the layout of every identifier.
pub(super) const fn identifier(class: u16, high: u8, low: u8) -> CanId {
    CanId::Standard((class & 7) << 8 | (high as u16 & 0xF) << 4 | (low as u16 & 0xF))
}

/// Class, high nibble and low nibble of a standard identifier; `None` for an extended one.
///
/// What has more than 11 bits gets a class above 7, which means nothing to any decoder.
pub(super) const fn split(id: CanId) -> Option<(u16, u8, u8)> {
    match id {
        CanId::Standard(id) => Some((id >> 8, (id >> 4 & 0xF) as u8, (id & 0xF) as u8)),
        CanId::Extended(_) => None,
    }
}
