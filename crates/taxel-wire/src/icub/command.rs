//! What the host says: board set-up and start of the stream, all in class 2 with the command in byte 0.
//!
//! No command but the firmware query is acknowledged. That a board took its configuration shows only by frames
//! from every enabled module.

use super::identifier::{class, identifier, split};
use crate::frame::{Frame, FrameKind};
use taxel_skin::{BoardAddress, Module};

/// The command byte that asks for the firmware version, and begins the reply.
pub(super) const FIRMWARE_VERSION: u8 = 0x1C;

/// The destination that all boards of a bus obey.
pub(super) const EVERYONE: u8 = 15;
const SET_TRANSMIT_MODE: u8 = 0x07;
const SET_BOARD_CONFIG: u8 = 0x4D;
const SET_TRIANGLE_CONFIG: u8 = 0x50;
/// The sense is inverted on the wire: 0 starts.
const START: u8 = 0;
const STOP: u8 = 1;
const ENABLED: u8 = 1;

/// Settings of a whole board, command 0x4D. It disables every module: a [`TriangleConfig`] must follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BoardConfig {
    /// 0 with drift compensation, 1 palm or fingertip, 2 without compensation, 3 ergoCub hand, 7 raw test,
    /// 8 drift compensation of the second version.
    pub kind: u8,
    /// Milliseconds between scans. 0 is not refused by boards and means nothing; MTB3 wraps above 209.
    /// The converter needs 36.9 ms for a scan, so that below that old values are repeated.
    pub period_ms: u8,
    /// The count that an unloaded value shows after the board's tare; pressure brings it down. 240 is usual.
    pub no_load: u8,
}

/// Settings of modules `first` to `last`, command 0x50. The board re-tares *all* its modules on receipt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TriangleConfig {
    /// First module of the range.
    pub first: Module,
    /// Last module of the range. Boards ignore the command if it is before `first`.
    pub last: Module,
    /// Right shift from converter units to counts: one count is 2^shift units. Usual is 2.
    pub shift: u8,
    /// Whether the modules send. Shift and offset apply either way.
    pub enabled: bool,
    /// Converter offset; 0x2200 is usual, 0x2000 for fingertips.
    pub cdc_offset: u16,
}

/// A command to one board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// Board-wide settings; disables every module.
    SetBoardConfig(BoardConfig),
    /// Settings of a range of modules; re-tares the whole board. MTB4 then needs [`Command::Start`] again.
    SetTriangles(TriangleConfig),
    /// Begin to send scans.
    Start,
    /// Stop sending scans.
    Stop,
    /// Ask for [`super::FirmwareVersion`].
    QueryFirmware {
        /// The protocol that the host needs: major, minor.
        protocol: (u8, u8),
    },
}

impl Command {
    /// The frame that tells `board` this command.
    #[must_use]
    pub fn encode(&self, board: BoardAddress) -> Frame {
        let id = identifier(class::POLLING_ANALOG, 0, board.get());
        match *self {
            Self::SetBoardConfig(BoardConfig { kind, period_ms, no_load }) => {
                Frame::of(id, [SET_BOARD_CONFIG, kind, period_ms, no_load])
            }
            Self::SetTriangles(TriangleConfig { first, last, shift, enabled, cdc_offset }) => {
                let [low, high] = cdc_offset.to_le_bytes();
                Frame::of(id, [SET_TRIANGLE_CONFIG, first.get(), last.get(), shift, u8::from(enabled), low, high])
            }
            Self::Start => Frame::of(id, [SET_TRANSMIT_MODE, START]),
            Self::Stop => Frame::of(id, [SET_TRANSMIT_MODE, STOP]),
            Self::QueryFirmware { protocol: (major, minor) } => Frame::of(id, [FIRMWARE_VERSION, major, minor]),
        }
    }

    /// The command in `frame` and the board that it is for.
    ///
    /// `None` where a board would do nothing either: not from the host, not to one board, unknown command, wrong
    /// length, or a module range that is out of bounds or reversed.
    #[must_use]
    pub fn decode(frame: &Frame) -> Option<(BoardAddress, Self)> {
        let (class::POLLING_ANALOG, 0, destination) = split(frame.id)? else { return None };
        if frame.kind != FrameKind::Data {
            return None;
        }
        let board = BoardAddress::new(destination).ok().filter(|_| destination != EVERYONE)?;
        let command = match *frame.bytes() {
            [SET_BOARD_CONFIG, kind, period_ms, no_load] => {
                Self::SetBoardConfig(BoardConfig { kind, period_ms, no_load })
            }
            [SET_TRIANGLE_CONFIG, first, last, shift, flags, low, high] if first <= last => {
                Self::SetTriangles(TriangleConfig {
                    first: Module::new(first).ok()?,
                    last: Module::new(last).ok()?,
                    shift,
                    enabled: flags & ENABLED != 0,
                    cdc_offset: u16::from_le_bytes([low, high]),
                })
            }
            [SET_TRANSMIT_MODE, START] => Self::Start,
            [SET_TRANSMIT_MODE, STOP] => Self::Stop,
            [FIRMWARE_VERSION, major, minor] => Self::QueryFirmware { protocol: (major, minor) },
            _ => return None,
        };
        Some((board, command))
    }
}
