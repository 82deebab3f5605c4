//! What a line holds, or why it holds nothing.

use taxel_skin::Time;
use thiserror::Error;

use crate::frame::Frame;

/// Bit 29 of an eight-digit identifier: the kernel's mark of an error frame.
pub(super) const ERROR_FLAG: u32 = 0x2000_0000;
pub(super) const EXTENDED_MASK: u32 = 0x1FFF_FFFF;
pub(super) const STANDARD_MASK: u16 = 0x7FF;
pub(super) const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// Which way a frame went, where the log says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// ` R` at the line's end, or `RX` before the identifier.
    Received,
    /// ` T` at the line's end, or `TX` before the identifier.
    Transmitted,
}

/// One line of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLine<'a> {
    /// The log's own clock, nanoseconds since its origin (usually 1970).
    pub time: Time,
    /// The interface that the frame was on.
    pub interface: &'a str,
    /// The frame.
    pub frame: Frame,
    /// Which way it went, if written down.
    pub direction: Option<Direction>,
}

/// Why a line is refused. Columns count bytes from 1.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Hash)]
pub enum LogError {
    /// Something else stands there.
    #[error("column {column}: found {}, expected {expected}", shown(*.found))]
    Syntax {
        /// Where.
        column: usize,
        /// The byte there, `None` at the line's end.
        found: Option<u8>,
        /// What a log has there.
        expected: &'static str,
    },
    /// The seconds do not fit a clock of 64-bit nanoseconds (up to 9223372036, the year 2262).
    #[error("column {column}: time is too large, expected at most 9223372036.854775807 s")]
    TimeRange {
        /// Where the seconds begin.
        column: usize,
    },
    /// The digits make an identifier with too many bits.
    #[error("column {column}: identifier {found:X} is too large, expected at most {max:X}")]
    IdRange {
        /// Where the identifier begins.
        column: usize,
        /// The identifier.
        found: u32,
        /// The largest with so many digits.
        max: u32,
    },
}

fn shown(found: Option<u8>) -> String {
    found.map_or_else(|| "the line's end".to_owned(), |byte| format!("`{}`", byte.escape_ascii()))
}
