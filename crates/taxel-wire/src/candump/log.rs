//! A frame as `candump -l` writes it: `4D0#40F0EFEFF1F1EEF0`.
//!
//! Behind the identifier's `#` up to eight data bytes, or `R` and a length digit for a remote frame, or a second `#`, a
//! digit of flags and up to 64 bytes of a CAN FD frame. Behind eight bytes `_9` to `_F` may be there, the length code as
//! it was on the bus, which means eight too. Then, if candump ran with `-x`, whether the frame was received or sent.

use super::cursor::{Cursor, hex};
use super::line::{Direction, LogError};
use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};

impl Cursor<'_> {
    pub(super) fn log_frame(&mut self, id: CanId, kind: FrameKind) -> Result<Frame, LogError> {
        self.take(b'#', "`#` after the identifier")?;
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
        if length == 8 && kind != FrameKind::Fd && self.peek() == Some(b'_') {
            self.at += 1;
            self.raw_length()?;
        }
        // Never refused: all lengths are within the kind's.
        Frame::new(id, kind, &data[..length]).ok_or_else(|| self.refuse("at most eight bytes"))
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
        if self.peek().and_then(hex).is_none() {
            return Err(self.refuse("a hexadecimal digit, the flags of a CAN FD frame"));
        }
        self.at += 1;
        Ok(())
    }

    fn data(&mut self, data: &mut [u8], end: &'static str) -> Result<usize, LogError> {
        let mut length = 0;
        while self.peek().is_some_and(|byte| byte != b' ' && byte != b'_') {
            let Some(byte) = data.get_mut(length) else {
                return Err(self.refuse(end));
            };
            *byte = self.byte(end)?;
            length += 1;
        }
        Ok(length)
    }

    pub(super) fn direction_after(&mut self) -> Result<Option<Direction>, LogError> {
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
