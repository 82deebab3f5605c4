//! A place in a line, and what both forms of a frame have there.

use super::line::{ERROR_FLAG, EXTENDED_MASK, LogError, STANDARD_MASK};
use crate::frame::{CanId, FrameKind};

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

/// The value of a hexadecimal digit.
pub(super) fn hex(byte: u8) -> Option<u8> {
    Some(HEX[usize::from(byte)]).filter(|&digit| digit != 0xFF)
}

/// A line and a place in it.
pub(super) struct Cursor<'a> {
    pub line: &'a [u8],
    pub at: usize,
}

impl<'a> Cursor<'a> {
    pub fn new(line: &'a [u8]) -> Self {
        Self { line, at: 0 }
    }

    pub fn peek(&self) -> Option<u8> {
        self.line.get(self.at).copied()
    }

    pub fn rest(&self) -> &'a [u8] {
        &self.line[self.at..]
    }

    #[cold]
    pub fn refuse(&self, expected: &'static str) -> LogError {
        LogError::Syntax { column: self.at + 1, found: self.peek(), expected }
    }

    pub fn take(&mut self, byte: u8, expected: &'static str) -> Result<(), LogError> {
        if self.peek() != Some(byte) {
            return Err(self.refuse(expected));
        }
        self.at += 1;
        Ok(())
    }

    pub fn skip_spaces(&mut self) {
        while self.peek() == Some(b' ') {
            self.at += 1;
        }
    }

    /// candump pads interface names to one width, so there may be several.
    pub fn spaces(&mut self) -> Result<(), LogError> {
        self.take(b' ', "a space")?;
        self.skip_spaces();
        Ok(())
    }

    pub fn digit(&mut self) -> Option<i64> {
        let digit = self.peek().filter(u8::is_ascii_digit)?;
        self.at += 1;
        Some(i64::from(digit - b'0'))
    }

    /// Names of Linux have at most 15 characters, those of converters any number.
    pub fn interface(&mut self) -> Result<&'a str, LogError> {
        let length = self.rest().iter().take_while(|byte| byte.is_ascii_graphic()).count();
        match str::from_utf8(&self.rest()[..length]) {
            Ok(name) if !name.is_empty() => {
                self.at += length;
                Ok(name)
            }
            _ => Err(self.refuse("an interface name of visible ASCII characters")),
        }
    }

    /// The identifier in three hexadecimal digits (11 bits) or eight (29 bits; with bit 29 set it is an error frame), up to
    /// the `#` or the space behind it.
    pub fn identifier(&mut self) -> Result<(CanId, FrameKind), LogError> {
        let start = self.at;
        let mut value = 0_u32;
        while let Some(digit) = self.peek().and_then(hex) {
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
        if !matches!(self.peek(), Some(b'#' | b' ')) {
            return Err(self.refuse("`#` after the identifier, or a space and the length"));
        }
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

    /// The length code of a frame with eight bytes, where it is not 8: `9` to `F`.
    pub fn raw_length(&mut self) -> Result<(), LogError> {
        let code = self.peek().and_then(hex).filter(|code| *code > 8);
        code.ok_or_else(|| self.refuse("a raw length code, `9` to `F`"))?;
        self.at += 1;
        Ok(())
    }

    /// A data byte in two hexadecimal digits, of which the first must be there; `none` is expected otherwise.
    pub fn byte(&mut self, none: &'static str) -> Result<u8, LogError> {
        let high = self.peek().and_then(hex).ok_or_else(|| self.refuse(none))?;
        self.at += 1;
        let low = self.peek().and_then(hex);
        let low = low.ok_or_else(|| self.refuse("the second hexadecimal digit of a data byte"))?;
        self.at += 1;
        Ok(high << 4 | low)
    }
}
