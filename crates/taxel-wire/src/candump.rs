//! The text of can-utils' `candump`, one frame a line: as `candump -l` writes it, and as `candump -ta` shows it.
//!
//! ```text
//! (1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0
//! (1600000000.000360) can0 3A1#R4
//! (1600000000.000480) can0 20000040#0000000000000000
//! (1600000000.000600) can0 180##5001122334455667788990A0B
//! (1600000000.000720) can0 4D0#40F0EFEFF1F1EEF0_C
//!  (1600000000.000120)  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0
//! ```
//!
//! The time in seconds with one to nine fractional digits; the interface; the identifier in three hexadecimal digits or
//! eight (with bit 29 set it is an error frame); the data, or `R` and the length that a remote frame asks for, or a second
//! `#`, a digit of flags and the data of a CAN FD frame. What follows behind a blank repeats the data (`-a`) or says which
//! way the frame went (`-x`), and is passed over.
//!
//! No line says whether its time is counted from 1970 (`-ta`), from the log's beginning (`-tz`), or from the frame before
//! (`-td`). Times from the beginning are as good as any; times from the frame before go up and down, and a reader of a
//! whole log can tell by that.

use taxel_skin::Time;
use thiserror::Error;

use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};

/// Bit 29 of an eight-digit identifier: the kernel's mark of an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;
const EXTENDED_MASK: u32 = 0x1FFF_FFFF;

/// One line of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogLine<'a> {
    /// The log's own clock, nanoseconds since its origin (usually 1970).
    pub time: Time,
    /// The interface that the frame was on.
    pub interface: &'a str,
    /// The frame.
    pub frame: Frame,
}

/// Why a line is refused.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("column {column}: found {}, expected {expected}", shown(*.found))]
pub struct LogError {
    /// Where, in bytes from 1.
    pub column: usize,
    /// The byte there, `None` at the line's end.
    pub found: Option<u8>,
    /// What a log has there.
    pub expected: &'static str,
}

fn shown(found: Option<u8>) -> String {
    found.map_or_else(|| "the line's end".to_owned(), |byte| format!("`{}`", byte.escape_ascii()))
}

/// Reads one line in either form; blanks around it and its line feed may be there. Allocates nothing.
///
/// Blank lines and comments are the caller's matter: they are refused like any other line that holds no frame.
///
/// # Errors
/// [`LogError`] with the column and what was expected there.
pub fn parse_line(line: &[u8]) -> Result<LogLine<'_>, LogError> {
    let mut cursor = Cursor { line: line.trim_ascii_end(), at: 0 };
    cursor.skip_blanks();
    let time = cursor.time()?;
    cursor.blanks()?;
    let interface = cursor.interface()?;
    cursor.blanks()?;
    let (id, kind) = cursor.identifier()?;
    let frame = match cursor.peek() {
        Some(b'#') => cursor.log_frame(id, kind)?,
        Some(b' ') => cursor.screen_frame(id, kind)?,
        _ => return cursor.refuse("`#` after three or eight digits of the identifier, or a blank and the length"),
    };
    match cursor.peek() {
        None | Some(b' ') => Ok(LogLine { time, interface, frame }),
        Some(_) => cursor.refuse("the line's end or a blank after the data"),
    }
}

/// A line and a place in it.
struct Cursor<'a> {
    line: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn peek(&self) -> Option<u8> {
        self.line.get(self.at).copied()
    }

    fn refuse<T>(&self, expected: &'static str) -> Result<T, LogError> {
        Err(LogError { column: self.at + 1, found: self.peek(), expected })
    }

    fn take(&mut self, byte: u8, expected: &'static str) -> Result<(), LogError> {
        if self.peek() != Some(byte) {
            return self.refuse(expected);
        }
        self.at += 1;
        Ok(())
    }

    fn skip_blanks(&mut self) {
        while self.peek() == Some(b' ') {
            self.at += 1;
        }
    }

    /// candump pads interface names to one width, so there may be several.
    fn blanks(&mut self) -> Result<(), LogError> {
        self.take(b' ', "a blank")?;
        self.skip_blanks();
        Ok(())
    }

    /// The number in up to `most` digits, and how many there are.
    #[inline]
    fn number<const RADIX: u32>(&mut self, most: usize) -> (u64, usize) {
        let (mut number, mut digits) = (0, 0);
        for byte in self.line[self.at..].iter().take(most) {
            let Some(digit) = char::from(*byte).to_digit(RADIX) else { break };
            number = number * u64::from(RADIX) + u64::from(digit);
            digits += 1;
        }
        self.at += digits;
        (number, digits)
    }

    fn time(&mut self) -> Result<Time, LogError> {
        self.take(b'(', "`(` and a time: record with `candump -l` or `candump -ta`")?;
        let start = self.at;
        let (seconds, digits) = self.number::<10>(18);
        if digits == 0 {
            return self.refuse("a digit of the seconds");
        }
        self.take(b'.', "`.` and the fraction of the seconds: record with `candump -l` or `candump -ta`")?;
        let (fraction, digits) = self.number::<10>(9);
        if digits == 0 {
            return self.refuse("a digit of the fraction");
        }
        self.take(b')', "`)` after one to nine digits of the fraction")?;
        let fraction = fraction * 10_u64.pow(9 - digits as u32);
        let nanos = seconds.checked_mul(1_000_000_000).and_then(|whole| whole.checked_add(fraction));
        let Some(nanos) = nanos.and_then(|nanos| i64::try_from(nanos).ok()) else {
            self.at = start;
            return self.refuse("at most 9223372036.854775807 s");
        };
        Ok(Time::from_nanos(nanos))
    }

    /// Names of Linux have at most 15 characters, those of converters any number.
    fn interface(&mut self) -> Result<&'a str, LogError> {
        let rest = &self.line[self.at..];
        let length = rest.iter().take_while(|byte| byte.is_ascii_graphic()).count();
        match str::from_utf8(&rest[..length]) {
            Ok(name) if !name.is_empty() => {
                self.at += length;
                Ok(name)
            }
            _ => self.refuse("an interface name of visible ASCII characters"),
        }
    }

    fn identifier(&mut self) -> Result<(CanId, FrameKind), LogError> {
        let start = self.at;
        let (value, digits) = self.number::<16>(8);
        let value = value as u32; // of eight digits
        match digits {
            3 if value <= 0x7FF => Ok((CanId::Standard(value as u16), FrameKind::Data)),
            8 if value <= EXTENDED_MASK => Ok((CanId::Extended(value), FrameKind::Data)),
            8 if value & !EXTENDED_MASK == ERROR_FLAG => Ok((CanId::Extended(value & EXTENDED_MASK), FrameKind::Error)),
            _ => {
                self.at = start;
                self.refuse("an identifier of three hexadecimal digits up to 7FF, or of eight up to 1FFFFFFF")
            }
        }
    }

    /// `#` and the data in one piece.
    fn log_frame(&mut self, id: CanId, kind: FrameKind) -> Result<Frame, LogError> {
        self.at += 1;
        let kind = match (self.peek(), kind) {
            (Some(b'R'), FrameKind::Data) => {
                self.at += 1;
                let (length, _) = self.number::<10>(1);
                return self.frame(id, FrameKind::Remote, &[0; FD_BYTES], length as usize);
            }
            (Some(b'#'), FrameKind::Data) => {
                self.at += 1;
                // They say how it was sent, and not what.
                if self.number::<16>(1).1 == 0 {
                    return self.refuse("a hexadecimal digit, the flags of a CAN FD frame");
                }
                FrameKind::Fd
            }
            _ => kind,
        };
        let (mut data, mut length) = ([0; FD_BYTES], 0);
        while self.peek().is_some_and(|byte| byte.is_ascii_hexdigit()) {
            let Some(byte) = data.get_mut(length) else { break };
            *byte = self.byte()?;
            length += 1;
        }
        // The length as it was on the bus, 9 to 15, which means eight too (`cc-len8-dlc`).
        if length == 8 && kind != FrameKind::Fd && matches!(self.line[self.at..], [b'_', b'9' | b'A'..=b'F', ..]) {
            self.at += 2;
        }
        self.frame(id, kind, &data, length)
    }

    /// `[8]`, or `[08]` of a CAN FD frame, and as many bytes, or `remote request`.
    fn screen_frame(&mut self, id: CanId, kind: FrameKind) -> Result<Frame, LogError> {
        self.skip_blanks();
        self.take(b'[', "`[` and the length")?;
        let (length, digits) = self.number::<10>(2);
        let kind = if digits == 2 && kind == FrameKind::Data { FrameKind::Fd } else { kind };
        self.take(b']', "`]` after one or two digits of the length")?;
        let (mut data, length) = ([0; FD_BYTES], length as usize);
        if self.line[self.at..].trim_ascii() == b"remote request" {
            return self.frame(id, FrameKind::Remote, &data, length);
        }
        for byte in data.iter_mut().take(length) {
            self.skip_blanks();
            *byte = self.byte()?;
        }
        self.frame(id, kind, &data, length)
    }

    fn byte(&mut self) -> Result<u8, LogError> {
        match self.number::<16>(2) {
            (byte, 2) => Ok(byte as u8),
            _ => self.refuse("a data byte of two hexadecimal digits"),
        }
    }

    fn frame(&self, id: CanId, kind: FrameKind, data: &[u8; FD_BYTES], length: usize) -> Result<Frame, LogError> {
        let frame = data.get(..length).and_then(|data| Frame::new(id, kind, data));
        frame.map_or_else(|| self.refuse("at most eight bytes, or 64 in a frame of CAN FD"), Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: CanId, kind: FrameKind, bytes: &[u8]) -> Frame {
        Frame::new(id, kind, bytes).unwrap()
    }

    fn read(line: &str) -> Frame {
        parse_line(line.as_bytes()).unwrap_or_else(|error| panic!("{line}: {error}")).frame
    }

    #[test]
    fn what_candump_writes_is_read() {
        let bytes = [0x40, 0xF0, 0xEF, 0xEF, 0xF1, 0xF1, 0xEE, 0xF0];
        let expected = LogLine {
            time: Time::from_nanos(1_600_000_000_000_120_000),
            interface: "can0",
            frame: frame(CanId::Standard(0x4D0), FrameKind::Data, &bytes),
        };
        for line in [
            "(1600000000.000120) can0 4D0#40F0EFEFF1F1EEF0",
            "(1600000000.00012)   can0 4d0#40f0efeff1f1eef0 R\r\n",
            " (1600000000.000120)  can0  4D0   [8]  40 F0 EF EF F1 F1 EE F0\n",
            " (1600000000.000120)  can0       4D0   [8]  40 F0 EF EF F1 F1 EE F0   '@.......'",
        ] {
            assert_eq!(parse_line(line.as_bytes()), Ok(expected), "{line}");
        }
        let named = parse_line(b"(0.1) usb-PEAK-System_PCAN-USB_Pro-0:1 001#").unwrap().interface;
        assert_eq!(named, "usb-PEAK-System_PCAN-USB_Pro-0:1", "of python-can");
    }

    #[test]
    fn every_kind_of_frame_is_read_in_both_forms() {
        let standard = CanId::Standard(0x123);
        let fd = frame(standard, FrameKind::Fd, &[0xAB; 12]);
        let pairs = [
            ("123#", "123   [0]", frame(standard, FrameKind::Data, &[])),
            ("123#R", "123   [0]  remote request", frame(standard, FrameKind::Remote, &[])),
            ("123#R4", "123   [4]  remote request", frame(standard, FrameKind::Remote, &[0; 4])),
            ("123##5ABABABABABABABABABABABAB", "123  [12]  AB AB AB AB AB AB AB AB AB AB AB AB", fd),
            ("00000123#01", "00000123   [1]  01", frame(CanId::Extended(0x123), FrameKind::Data, &[1])),
            (
                "20000040#0000000000000000",
                "20000040   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
                frame(CanId::Extended(0x40), FrameKind::Error, &[0; 8]),
            ),
        ];
        for (log, screen, expected) in pairs {
            assert_eq!(read(&format!("(0.1) can0 {log}")), expected, "{log}");
            assert_eq!(read(&format!(" (000.100000)  can0  {screen}")), expected, "{screen}");
        }
    }

    #[test]
    fn times_to_the_nanosecond_and_to_the_end_of_the_clock() {
        let nanos = |text: &str| parse_line(format!("({text}) c 001#").as_bytes()).map(|line| line.time.as_nanos());
        assert_eq!(nanos("0.5"), Ok(500_000_000));
        assert_eq!(nanos("0000000012.000000001"), Ok(12_000_000_001));
        assert_eq!(nanos("9223372036.854775807"), Ok(i64::MAX));
        for late in ["9223372036.854775808", "99999999999.0", "999999999999999999.0"] {
            assert_eq!(nanos(late).unwrap_err().expected, "at most 9223372036.854775807 s", "{late}");
        }
    }

    #[test]
    fn refusals_name_column_and_expectation() {
        const IDENTIFIER: &str = "an identifier of three hexadecimal digits up to 7FF, or of eight up to 1FFFFFFF";
        const BYTE: &str = "a data byte of two hexadecimal digits";
        const MOST: &str = "at most eight bytes, or 64 in a frame of CAN FD";
        const END: &str = "the line's end or a blank after the data";
        let table = [
            ("", 1, "`(` and a time: record with `candump -l` or `candump -ta`"),
            ("  can0  4D0   [0]", 3, "`(` and a time: record with `candump -l` or `candump -ta`"),
            ("(-1.0) c 001#", 2, "a digit of the seconds"),
            (
                "(2020-09-13 12:26:40.0) c 001#",
                6,
                "`.` and the fraction of the seconds: record with `candump -l` or `candump -ta`",
            ),
            ("(1.) c 001#", 4, "a digit of the fraction"),
            ("(1.0123456789) c 001#", 13, "`)` after one to nine digits of the fraction"),
            ("(1.0)c 001#", 6, "a blank"),
            ("(1.0) \u{e9}th 001#", 7, "an interface name of visible ASCII characters"),
            ("(1.0) c 01#", 9, IDENTIFIER),
            ("(1.0) c 800#", 9, IDENTIFIER),
            ("(1.0) c 001:11", 12, "`#` after three or eight digits of the identifier, or a blank and the length"),
            ("(1.0) c 001##", 14, "a hexadecimal digit, the flags of a CAN FD frame"),
            ("(1.0) c 001#112233445566778899", 31, MOST),
            ("(1.0) c 001#R9", 15, MOST),
            ("(1.0) c 001#11.22", 15, END),
            (" (1.0)  c  001   8  11", 18, "`[` and the length"),
            (" (1.0)  c  001   [123]", 21, "`]` after one or two digits of the length"),
            (" (1.0)  c  001   [2]  11", 25, BYTE),
            (" (1.0)  c  001   [1]  01100110", 25, END),
        ];
        for (line, column, expected) in table {
            let found = line.as_bytes().get(column - 1).copied();
            assert_eq!(parse_line(line.as_bytes()), Err(LogError { column, found, expected }), "{line:?}");
        }
        let error = parse_line("(1.0) \u{e9}".as_bytes()).unwrap_err().to_string();
        assert_eq!(error, "column 7: found `\\xc3`, expected an interface name of visible ASCII characters");
    }
}
