//! The log text of can-utils' `candump -l`, one frame a line, both ways.
//!
//! ```text
//! (1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0
//! (1600000000.000240) can0 18AAA301#0102 R
//! (1600000000.000360) can0 3A1#R4
//! (1600000000.000480) can0 20000040#0000000000000000
//! (1600000000.000600) can0 180##5001122334455667788990A0B
//! ```
//!
//! Time in seconds with one to nine fractional digits; interface; identifier in three (11 bits) or eight hexadecimal
//! digits (29 bits; with bit 29 set it is an error frame); up to eight data bytes, or `R` and a length digit for a
//! remote frame, or a second `#`, a digit of flags and up to 64 bytes of a CAN FD frame; then, if candump ran with `-x`, whether the frame was received or sent.

use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};
use std::fmt;
use taxel_skin::Time;
use thiserror::Error;

/// Bit 29 of an eight-digit identifier: the kernel's mark of an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;
const EXTENDED_MASK: u32 = 0x1FFF_FFFF;
const STANDARD_MASK: u16 = 0x7FF;
const NANOS_PER_SECOND: i64 = 1_000_000_000;
/// Names of network interfaces in Linux have at most 15 bytes.
const INTERFACE_BYTES: usize = 15;

/// Which way a frame went, where the log says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Direction {
    /// ` R` at the line's end.
    Received,
    /// ` T` at the line's end.
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

/// Reads one line; a line feed at its end, with or without carriage return, may be there.
///
/// Blank lines and comments are the caller's matter: they are refused like any other line that holds no frame.
///
/// # Errors
/// [`LogError`] with the column and what was expected there.
pub fn parse_line(line: &str) -> Result<LogLine<'_>, LogError> {
    parse_line_bytes(line.as_bytes())
}

/// [`parse_line`] for bytes that need not be text; allocates nothing.
///
/// # Errors
/// As [`parse_line`].
pub fn parse_line_bytes(line: &[u8]) -> Result<LogLine<'_>, LogError> {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let mut cursor = Cursor { line, at: 0 };
    let time = cursor.time()?;
    cursor.spaces()?;
    let interface = cursor.interface()?;
    cursor.spaces()?;
    let frame = cursor.frame()?;
    let direction = cursor.direction()?;
    Ok(LogLine { time, interface, frame, direction })
}

/// Writes `frame` as one line with its line feed, so that [`parse_line`] gives the same frame and time back.
///
/// Six fractional digits as candump writes, nine where the time has nanoseconds. The text has no time before the
/// clock's origin: such a time is written as the origin. Identifier bits beyond 11 or 29, which no bus
/// carries, are cut.
///
/// # Errors
/// Only what `out` itself reports; a `String` never does.
pub fn write_line(out: &mut impl fmt::Write, time: Time, interface: &str, frame: &Frame) -> fmt::Result {
    let nanos = time.as_nanos().max(0);
    let (seconds, fraction) = (nanos / NANOS_PER_SECOND, nanos % NANOS_PER_SECOND);
    if fraction % 1000 == 0 {
        write!(out, "({seconds}.{:06}) {interface} ", fraction / 1000)?;
    } else {
        write!(out, "({seconds}.{fraction:09}) {interface} ")?;
    }
    match (frame.kind, frame.id) {
        (FrameKind::Error, CanId::Standard(id)) => write!(out, "{:08X}#", ERROR_FLAG | u32::from(id & STANDARD_MASK))?,
        (FrameKind::Error, CanId::Extended(id)) => write!(out, "{:08X}#", ERROR_FLAG | id & EXTENDED_MASK)?,
        (_, CanId::Standard(id)) => write!(out, "{:03X}#", id & STANDARD_MASK)?,
        (_, CanId::Extended(id)) => write!(out, "{:08X}#", id & EXTENDED_MASK)?,
    }
    if frame.kind == FrameKind::Fd {
        out.write_str("#0")?; // its flags are not kept
    }
    match (frame.kind, frame.bytes()) {
        (FrameKind::Remote, []) => out.write_str("R\n"),
        (FrameKind::Remote, bytes) => writeln!(out, "R{}", bytes.len()),
        (_, bytes) => {
            for byte in bytes {
                write!(out, "{byte:02X}")?;
            }
            out.write_char('\n')
        }
    }
}

/// The value of each hexadecimal digit, 0xFF for every other byte.
const HEX: [u8; 256] = {
    let mut table = [0xFF; 256];
    let mut digit = 0;
    while digit < 16 {
        table[b"0123456789ABCDEF"[digit] as usize] = digit as u8;
        table[b"0123456789abcdef"[digit] as usize] = digit as u8;
        digit += 1;
    }
    table
};

struct Cursor<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn peek(&self) -> Option<u8> {
        self.line.get(self.at).copied()
    }

    #[cold]
    fn refuse(&self, expected: &'static str) -> LogError {
        LogError::Syntax { column: self.at + 1, found: self.peek(), expected }
    }

    fn take(&mut self, byte: u8, expected: &'static str) -> Result<(), LogError> {
        if self.peek() != Some(byte) {
            return Err(self.refuse(expected));
        }
        self.at += 1;
        Ok(())
    }

    /// candump pads interface names to one width, so there may be several.
    fn spaces(&mut self) -> Result<(), LogError> {
        self.take(b' ', "a space")?;
        while self.peek() == Some(b' ') {
            self.at += 1;
        }
        Ok(())
    }

    fn digit(&mut self) -> Option<i64> {
        let digit = self.peek().filter(u8::is_ascii_digit)?;
        self.at += 1;
        Some(i64::from(digit - b'0'))
    }

    fn time(&mut self) -> Result<Time, LogError> {
        self.take(b'(', "`(` and a time")?;
        let column = self.at + 1;
        let out_of_range = LogError::TimeRange { column };
        let mut seconds = self.digit().ok_or_else(|| self.refuse("a digit of the seconds"))?;
        while let Some(digit) = self.digit() {
            // Bounded here, so that no number of digits overflows.
            if seconds > i64::MAX / NANOS_PER_SECOND {
                return Err(out_of_range);
            }
            seconds = seconds * 10 + digit;
        }
        self.take(b'.', "`.` and the fraction of the seconds")?;
        let mut nanos = 0;
        let mut unit = NANOS_PER_SECOND;
        while unit > 1 {
            let Some(digit) = self.digit() else { break };
            unit /= 10;
            nanos += digit * unit;
        }
        if unit == NANOS_PER_SECOND {
            return Err(self.refuse("a digit of the fraction"));
        }
        self.take(b')', "`)` after one to nine digits of the fraction")?;
        let total = seconds.checked_mul(NANOS_PER_SECOND).and_then(|whole| whole.checked_add(nanos));
        total.map(Time::from_nanos).ok_or(out_of_range)
    }

    fn interface(&mut self) -> Result<&'a str, LogError> {
        const EXPECTED: &str = "an interface name of 1 to 15 visible ASCII characters";
        let rest = &self.line[self.at..];
        let length = rest.iter().take_while(|byte| byte.is_ascii_graphic()).count();
        if length > INTERFACE_BYTES {
            self.at += INTERFACE_BYTES;
            return Err(self.refuse("a space: an interface name has at most 15 characters"));
        }
        match str::from_utf8(&rest[..length]) {
            Ok(name) if !name.is_empty() => {
                self.at += length;
                Ok(name)
            }
            _ => Err(self.refuse(EXPECTED)),
        }
    }

    fn frame(&mut self) -> Result<Frame, LogError> {
        let (id, kind) = self.identifier()?;
        let mut data = [0; FD_BYTES];
        let (kind, length) = match (self.peek(), kind) {
            (Some(b'R'), FrameKind::Data) => (FrameKind::Remote, self.remote_length()?),
            (Some(b'#'), FrameKind::Data) => {
                self.at += 1;
                self.flags()?;
                (FrameKind::Fd, self.data(&mut data, "the end of up to 64 data bytes, two hexadecimal digits each")?)
            }
            _ => (kind, self.data(&mut data[..8], "the end of up to eight data bytes, two hexadecimal digits each")?),
        };
        // Never refused: all lengths are within the kind's.
        Frame::new(id, kind, &data[..length]).ok_or_else(|| self.refuse("at most eight bytes"))
    }

    /// The identifier and its `#`.
    fn identifier(&mut self) -> Result<(CanId, FrameKind), LogError> {
        let start = self.at;
        let mut value = 0_u32;
        while let Some(digit) = self.peek().map(|byte| HEX[usize::from(byte)]).filter(|&digit| digit != 0xFF) {
            if self.at - start == 8 {
                return Err(self.refuse("`#` after three or eight digits of the identifier"));
            }
            value = value << 4 | u32::from(digit);
            self.at += 1;
        }
        let digits = self.at - start;
        if digits != 3 && digits != 8 {
            return Err(self.refuse("an identifier of three or eight hexadecimal digits"));
        }
        self.take(b'#', "`#` after the identifier")?;
        let max = if digits == 3 { u32::from(STANDARD_MASK) } else { ERROR_FLAG | EXTENDED_MASK };
        if value > max {
            return Err(LogError::IdRange { column: start + 1, found: value, max });
        }
        Ok(match digits {
            3 => (CanId::Standard(value as u16), FrameKind::Data),
            _ if value & ERROR_FLAG != 0 => (CanId::Extended(value & EXTENDED_MASK), FrameKind::Error),
            _ => (CanId::Extended(value), FrameKind::Data),
        })
    }

    fn remote_length(&mut self) -> Result<usize, LogError> {
        self.at += 1;
        match self.peek() {
            Some(digit @ b'0'..=b'8') => {
                self.at += 1;
                Ok(usize::from(digit - b'0'))
            }
            Some(b'0'..=b'9') => Err(self.refuse("a length from 0 to 8")),
            _ => Ok(0),
        }
    }

    /// The flags of a CAN FD frame, which say how it was sent and not what.
    fn flags(&mut self) -> Result<(), LogError> {
        if self.peek().is_none_or(|byte| HEX[usize::from(byte)] == 0xFF) {
            return Err(self.refuse("a hexadecimal digit, the flags of a CAN FD frame"));
        }
        self.at += 1;
        Ok(())
    }

    fn data(&mut self, data: &mut [u8], end: &'static str) -> Result<usize, LogError> {
        let mut length = 0;
        while let Some(high) = self.peek().filter(|&byte| byte != b' ') {
            let high = HEX[usize::from(high)];
            let Some(byte) = data.get_mut(length).filter(|_| high != 0xFF) else {
                return Err(self.refuse(end));
            };
            self.at += 1;
            let low = self.peek().map_or(0xFF, |low| HEX[usize::from(low)]);
            if low == 0xFF {
                return Err(self.refuse("the second hexadecimal digit of a data byte"));
            }
            self.at += 1;
            *byte = high << 4 | low;
            length += 1;
        }
        Ok(length)
    }

    fn direction(&mut self) -> Result<Option<Direction>, LogError> {
        if self.at == self.line.len() {
            return Ok(None);
        }
        self.take(b' ', "the line's end, or a space and the direction")?;
        let direction = match self.peek() {
            Some(b'R') => Direction::Received,
            Some(b'T') => Direction::Transmitted,
            _ => return Err(self.refuse("the direction, `R` or `T`")),
        };
        self.at += 1;
        if self.at < self.line.len() {
            return Err(self.refuse("the line's end"));
        }
        Ok(Some(direction))
    }
}

#[cfg(test)]
mod tests;
