//! What a board says: one frame to one meaning, total over all frames.

use super::command::FIRMWARE_VERSION;
use super::identifier::{class, identifier, split};
use crate::frame::{CanId, Frame, FrameKind};
use taxel_skin::{BoardAddress, Module};
use thiserror::Error;

/// First byte of a head frame.
const HEAD: u8 = 0x40;
/// First byte of a tail frame.
const TAIL: u8 = 0xC0;
/// Message type of a thermometer in the protocol's manual.
const THERMOMETER: u8 = 0xE;
/// Message type of a thermometer from firmware that was built with a wrong constant (since October 2025).
const THERMOMETER_MISNUMBERED: u8 = 0xF;
/// Low nibble of the overflow notice.
const OVERFLOW: u8 = 5;
/// First byte of a thermometer frame: bit 0 says that the first sensor is in, bit 1 the second.
const FIRST_SENSOR: u8 = 0x01;
const BOTH_SENSORS: u8 = 0x03;

/// The health of a module's twelve values, from bytes 6 and 7 of the tail frame. All zero is healthy.
///
/// The meanings are those of both firmwares; other hosts print bits 0 and 1 under other names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct StatusWord(pub u16);

impl StatusWord {
    /// Nothing to report.
    #[must_use]
    pub const fn is_ok(self) -> bool {
        self.0 == 0
    }

    /// Bit 0: a value read exactly 0 although its stored offset is not 0; the converter did not answer.
    ///
    /// After five of these the board silently takes a new zero for all its modules.
    #[must_use]
    pub const fn no_ack(self) -> bool {
        self.0 & 1 != 0
    }

    /// Bit 1: all twelve values read 0xFFFF; no triangle is there.
    #[must_use]
    pub const fn not_connected(self) -> bool {
        self.0 & 2 != 0
    }

    /// Bit 4 + `value`: that value, 0 to 11, lies beyond twice the clip limits. False for any other `value`.
    #[must_use]
    pub const fn out_of_range(self, value: usize) -> bool {
        value < 12 && self.0 >> (4 + value) & 1 != 0
    }
}

/// A board's answer to the firmware query.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FirmwareVersion {
    /// 5 MTB, 11 MTB4, 15 PSC, 16 MTB4W, 20 MTB4C.
    pub board_type: u8,
    /// Application: major, minor, build.
    pub app: (u8, u8, u8),
    /// Protocol that the board speaks: major, minor.
    pub protocol: (u8, u8),
    /// Whether the board holds its protocol compatible with the one asked for.
    pub compatible: bool,
}

impl FirmwareVersion {
    /// MTB4 firmware 1.21.0 up to, not including, 1.25.0 sends each frame once only: a lost arbitration loses
    /// the frame, so that orphan halves are normal on a busy bus. Worth a warning to the operator.
    #[must_use]
    pub const fn loses_arbitrated_frames(&self) -> bool {
        self.board_type == 11 && self.app.0 == 1 && self.app.1 >= 21 && self.app.1 < 25
    }
}

/// A skin board's message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Message {
    /// Values 0 to 6 of a module, raw counts that go down with pressure.
    Head {
        /// The sender.
        board: BoardAddress,
        /// Its module.
        module: Module,
        /// Values 0 to 6.
        values: [u8; 7],
    },
    /// Values 7 to 11 of a module and its status.
    Tail {
        /// The sender.
        board: BoardAddress,
        /// Its module.
        module: Module,
        /// Values 7 to 11.
        values: [u8; 5],
        /// Health of all twelve values.
        status: StatusWord,
    },
    /// The board's temperature.
    Thermometer {
        /// The sender.
        board: BoardAddress,
        /// First sensor, in tenths of a degree Celsius.
        deci_celsius: i16,
    },
    /// The reply to [`super::Command::QueryFirmware`].
    FirmwareVersion {
        /// The sender.
        board: BoardAddress,
        /// What it runs.
        version: FirmwareVersion,
    },
    /// The board's own send queue was full; its 20 frames were thrown away.
    BoardOverflow {
        /// The sender.
        board: BoardAddress,
    },
}

/// Why a frame is no skin message.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// Of no concern: another device's identifier, the host's own command, or a reply to somebody else.
    #[error("not a message of a skin board")]
    NotSkin,
    /// An error frame, or a remote frame with the identifier of a skin board.
    #[error("a {0:?} frame, expected a data frame")]
    Kind(FrameKind),
    /// The frame is longer or shorter than its kind of message.
    #[error("frame {id} has {found} bytes, expected one of {expected:?}")]
    Length {
        /// The frame's identifier.
        id: CanId,
        /// Its number of bytes.
        found: u8,
        /// The numbers of bytes that are legal.
        expected: &'static [u8],
    },
    /// The first byte, which tells head, tail and thermometer apart, is none of theirs.
    #[error("frame {id} begins with hexadecimal {found:02X}, expected one of {expected:02X?}")]
    Marker {
        /// The frame's identifier.
        id: CanId,
        /// Its first byte.
        found: u8,
        /// The first bytes that are legal.
        expected: &'static [u8],
    },
    /// A skin identifier whose sender cannot be a board.
    #[error("frame {id} comes from address {found}, expected a board address from 1 to 15")]
    Address {
        /// The frame's identifier.
        id: CanId,
        /// The address in it.
        found: u8,
    },
}

/// The meaning of `frame`. Total: every frame is a message or is refused with the reason.
///
/// Accepted are skin data in class 4, in class 3 (boards in legacy mode) and tails in class 6 (one vendor build);
/// thermometers in class 3 with type 0xE or 0xF, told from the legacy modules 14 and 15 by length and first byte;
/// the firmware reply in class 2; the overflow notice in class 7.
///
/// # Errors
/// [`Refusal::NotSkin`] for an identifier of no concern, else the first thing that is wrong with the frame.
pub fn decode(frame: &Frame) -> Result<Message, Refusal> {
    if frame.kind == FrameKind::Error {
        return Err(Refusal::Kind(FrameKind::Error));
    }
    let (class, source, low) = split(frame.id).ok_or(Refusal::NotSkin)?;
    let concerns_skin = match class {
        class::PERIODIC_ANALOG | class::PERIODIC_SKIN | class::BATTERY => true,
        class::POLLING_ANALOG => source != 0 && low == 0,
        class::MANAGEMENT => source != 0 && low == OVERFLOW,
        _ => false,
    };
    if !concerns_skin {
        return Err(Refusal::NotSkin);
    }
    if frame.kind != FrameKind::Data {
        return Err(Refusal::Kind(frame.kind));
    }
    let board = BoardAddress::new(source).map_err(|_| Refusal::Address { id: frame.id, found: source })?;
    match class {
        class::POLLING_ANALOG => decode_reply(frame, board),
        class::MANAGEMENT if frame.bytes().is_empty() => Ok(Message::BoardOverflow { board }),
        class::MANAGEMENT => Err(wrong_length(frame, &[0])),
        class::PERIODIC_ANALOG if low == THERMOMETER || low == THERMOMETER_MISNUMBERED => {
            decode_thermometer_or_module(frame, board, low)
        }
        class::BATTERY => decode_module(frame, board, low, &[TAIL]),
        _ => decode_module(frame, board, low, &[HEAD, TAIL]),
    }
}

fn decode_module(frame: &Frame, board: BoardAddress, low: u8, markers: &'static [u8]) -> Result<Message, Refusal> {
    let module = Module::from_nibble(low);
    match *frame.bytes() {
        [HEAD, v0, v1, v2, v3, v4, v5, v6] if markers.contains(&HEAD) => {
            Ok(Message::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] })
        }
        [TAIL, v7, v8, v9, v10, v11, high, low] => {
            let status = StatusWord(u16::from_be_bytes([high, low]));
            Ok(Message::Tail { board, module, values: [v7, v8, v9, v10, v11], status })
        }
        [found, _, _, _, _, _, _, _] => Err(Refusal::Marker { id: frame.id, found, expected: markers }),
        _ => Err(wrong_length(frame, &[8])),
    }
}

fn decode_thermometer_or_module(frame: &Frame, board: BoardAddress, low: u8) -> Result<Message, Refusal> {
    match *frame.bytes() {
        [FIRST_SENSOR | BOTH_SENSORS, t0, t1, _, _] => {
            Ok(Message::Thermometer { board, deci_celsius: i16::from_le_bytes([t0, t1]) })
        }
        [found, _, _, _, _] => Err(Refusal::Marker { id: frame.id, found, expected: &[FIRST_SENSOR, BOTH_SENSORS] }),
        [_, _, _, _, _, _, _, _] => decode_module(frame, board, low, &[HEAD, TAIL]),
        _ => Err(wrong_length(frame, &[5, 8])),
    }
}

fn decode_reply(frame: &Frame, board: BoardAddress) -> Result<Message, Refusal> {
    match *frame.bytes() {
        [FIRMWARE_VERSION, board_type, major, minor, build, protocol_major, protocol_minor, compatible] => {
            let version = FirmwareVersion {
                board_type,
                app: (major, minor, build),
                protocol: (protocol_major, protocol_minor),
                compatible: compatible != 0,
            };
            Ok(Message::FirmwareVersion { board, version })
        }
        [] | [FIRMWARE_VERSION, ..] => Err(wrong_length(frame, &[8])),
        // A reply to a command that only some other host on the bus sends.
        _ => Err(Refusal::NotSkin),
    }
}

fn wrong_length(frame: &Frame, expected: &'static [u8]) -> Refusal {
    Refusal::Length { id: frame.id, found: frame.bytes().len() as u8, expected }
}

impl Message {
    /// The frame that a board of today sends: skin data in class 4, thermometers with type 0xE.
    #[must_use]
    pub fn encode(&self) -> Frame {
        match *self {
            Self::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] } => {
                let id = identifier(class::PERIODIC_SKIN, board.get(), module.get());
                Frame::of(id, [HEAD, v0, v1, v2, v3, v4, v5, v6])
            }
            Self::Tail { board, module, values: [v7, v8, v9, v10, v11], status } => {
                let id = identifier(class::PERIODIC_SKIN, board.get(), module.get());
                let [high, low] = status.0.to_be_bytes();
                Frame::of(id, [TAIL, v7, v8, v9, v10, v11, high, low])
            }
            Self::Thermometer { board, deci_celsius } => {
                let [t0, t1] = deci_celsius.to_le_bytes();
                let id = identifier(class::PERIODIC_ANALOG, board.get(), THERMOMETER);
                Frame::of(id, [FIRST_SENSOR, t0, t1, 0, 0])
            }
            Self::FirmwareVersion { board, version } => {
                let FirmwareVersion { board_type, app, protocol, compatible } = version;
                let id = identifier(class::POLLING_ANALOG, board.get(), 0);
                let flag = u8::from(compatible);
                Frame::of(id, [FIRMWARE_VERSION, board_type, app.0, app.1, app.2, protocol.0, protocol.1, flag])
            }
            Self::BoardOverflow { board } => Frame::of(identifier(class::MANAGEMENT, board.get(), OVERFLOW), []),
        }
    }
}
