//! A frame as `candump` shows it on a screen: `4D0   [8]  40 F0 EF EF F1 F1 EE F0`.
//!
//! Before the identifier, if candump ran with `-x`, whether the frame was received or sent, and two flags of CAN FD. Behind
//! it the length, in two digits for a CAN FD frame; then `remote request`, or as many data bytes. What follows them in
//! quotes (`-a`) repeats them, and `ERRORFRAME` (`-e`) what bit 29 of the identifier says.

use super::cursor::Cursor;
use super::line::{Direction, LogError};
use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};

const REMOTE: &[u8] = b"remote request";

impl Cursor<'_> {
    pub(super) fn direction_before(&mut self) -> Result<Option<Direction>, LogError> {
        let direction = match self.rest() {
            [b'R', b'X', b' ', ..] => Direction::Received,
            [b'T', b'X', b' ', ..] => Direction::Transmitted,
            _ => return Ok(None),
        };
        self.at += 2;
        self.spaces()?;
        for (flag, expected) in
            [(b'B', "`B` or `-`, whether the bit rate was switched"), (b'E', "`E` or `-`, the error state")]
        {
            match self.peek() {
                Some(byte) if byte == flag || byte == b'-' => self.at += 1,
                _ => return Err(self.refuse(expected)),
            }
            self.spaces()?;
        }
        Ok(Some(direction))
    }

    pub(super) fn screen_frame(&mut self, id: CanId, kind: FrameKind) -> Result<Frame, LogError> {
        self.spaces()?;
        let (kind, length) = self.length(kind)?;
        let mut data = [0; FD_BYTES];
        if kind == FrameKind::Data && self.rest().trim_ascii_start() == REMOTE {
            // Never refused, like the one below: the length is within the kind's.
            return Frame::new(id, FrameKind::Remote, &data[..length])
                .ok_or_else(|| self.refuse("at most eight bytes"));
        }
        for byte in &mut data[..length] {
            const MORE: &str = "a space and a data byte of two hexadecimal digits: the length says that there are more";
            self.take(b' ', MORE)?;
            self.skip_spaces();
            *byte = self.byte(MORE)?;
        }
        self.end(kind)?;
        Frame::new(id, kind, &data[..length]).ok_or_else(|| self.refuse("at most eight bytes"))
    }

    /// `[8]`, or `[08]` of a CAN FD frame, or `{F}`: eight bytes whose length code was F on the bus (`candump -8`).
    fn length(&mut self, kind: FrameKind) -> Result<(FrameKind, usize), LogError> {
        if self.peek() == Some(b'{') {
            self.at += 1;
            self.raw_length()?;
            self.take(b'}', "`}` after the raw length code")?;
            return Ok((kind, 8));
        }
        self.take(b'[', "`[` and the length")?;
        let start = self.at;
        let mut length = self.digit().ok_or_else(|| self.refuse("a digit of the length"))?;
        let second = self.digit();
        if let Some(second) = second {
            length = 10 * length + second;
        }
        let (kind, most, expected) = match (kind, second) {
            (FrameKind::Data, Some(_)) => (FrameKind::Fd, 64, "a length from 00 to 64"),
            _ => (kind, 8, "a length from 0 to 8"),
        };
        if length > most {
            self.at = start;
            return Err(self.refuse(expected));
        }
        self.take(b']', "`]` after one or two digits of the length")?;
        Ok((kind, length as usize))
    }

    /// What may follow the data.
    fn end(&mut self, kind: FrameKind) -> Result<(), LogError> {
        const EXPECTED: &str = "the line's end: so many data bytes are what the length says";
        if self.at == self.line.len() {
            return Ok(());
        }
        self.take(b' ', EXPECTED)?;
        self.skip_spaces();
        match self.rest() {
            [b'\'', ..] => Ok(()),
            rest if kind == FrameKind::Error && rest.starts_with(b"ERRORFRAME") => Ok(()),
            _ => Err(self.refuse(EXPECTED)),
        }
    }
}
