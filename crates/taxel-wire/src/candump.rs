//! The text of can-utils' `candump`, one frame a line: as `candump -l` writes it, both ways, and as `candump -ta` shows
//! it, to be read.
//!
//! ```text
//! (1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0
//! (1600000000.000240) can0 18AAA301#0102 R
//! (1600000000.000360) can0 3A1#R4
//! (1600000000.000480) can0 20000040#0000000000000000
//! (1600000000.000600) can0 180##5001122334455667788990A0B
//!  (1600000000.000120)  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0
//!  (2020-09-13 12:26:40.000240)  can0  RX - -  18AAA301   [2]  01 02
//! ```
//!
//! Time in seconds with one to nine fractional digits, or as a date, which `candump -tA` writes without saying of which
//! time zone: it is read as one of UTC. Then the interface, and the frame in one of two forms, `log` and `screen`.
//!
//! No line says whether its time is counted from 1970 (`-ta`), from the log's beginning (`-tz`), or from the frame before
//! (`-td`). Times from the beginning are as good as any; times from the frame before go up and down, and whoever reads a
//! whole log can tell by that.

mod cursor;
mod line;
mod log;
mod screen;
mod time;

use std::fmt;

use cursor::Cursor;
pub use line::{Direction, LogError, LogLine};
use line::{ERROR_FLAG, EXTENDED_MASK, NANOS_PER_SECOND, STANDARD_MASK};
use taxel_skin::Time;

use crate::frame::{CanId, Frame, FrameKind};

/// Reads one line in either form. Blanks before it and after it, and the line's end in any of its forms, may be there.
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
    let mut cursor = Cursor::new(line.trim_ascii_end());
    cursor.skip_spaces();
    let time = cursor.time()?;
    cursor.spaces()?;
    let interface = cursor.interface()?;
    cursor.spaces()?;
    let flagged = cursor.direction_before()?;
    let (id, kind) = cursor.identifier()?;
    let (frame, direction) = if flagged.is_some() || cursor.peek() == Some(b' ') {
        (cursor.screen_frame(id, kind)?, flagged)
    } else {
        (cursor.log_frame(id, kind)?, cursor.direction_after()?)
    };
    Ok(LogLine { time, interface, frame, direction })
}

/// Writes `frame` as one line as `candump -l` does, with its line feed, so that [`parse_line`] gives the same frame and time back.
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

#[cfg(test)]
mod tests;
