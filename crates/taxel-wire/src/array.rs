//! An array of taxels in frames of any sensor: from the bytes of a frame to raw counts.

use thiserror::Error;

use crate::bits::{BitField, FrameMatch};
use crate::frame::{CanId, Frame};

/// One taxel's number in a frame, and how it becomes a raw count of at most sixteen bits.
///
/// `count = (number - low) >> shift`, held within 0 and `top`. So a signed number, or one that moves in a small part of
/// its range, begins at 0, and a number of more than sixteen bits leaves out its lowest, which are noise: a converter of
/// 24 bits whose noise is less than a 65,536th of the range that is used would be the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CountField {
    /// Where the number lies.
    pub field: BitField,
    /// The number that is the count 0.
    pub low: i64,
    /// Bits that are left out, 0 to 63.
    pub shift: u8,
    /// The greatest count.
    pub top: u16,
}

impl CountField {
    /// The count; `None` if the bytes end before the number does.
    #[must_use]
    pub fn read(&self, bytes: &[u8]) -> Option<u16> {
        let number = self.field.read(bytes)?;
        let above = (number - i128::from(self.low)).max(0) >> self.shift.min(63);
        Some(above.min(i128::from(self.top)) as u16)
    }
}

/// The taxels in the frames of one identifier, or of one multiplexed kind of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSpec {
    /// Which frames.
    pub frames: FrameMatch,
    /// Taxel and its count, in any order.
    pub counts: Vec<(u16, CountField)>,
}

/// Why a frame that should hold taxels holds none.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("frame {id} has {found} bytes, expected at least {needed}")]
pub struct TooShort {
    /// The frame's identifier.
    pub id: CanId,
    /// Its number of bytes.
    pub found: usize,
    /// Bytes up to the end of the last number.
    pub needed: usize,
}

impl FrameSpec {
    /// How many bytes a frame needs to hold all its taxels.
    #[must_use]
    pub fn bytes_needed(&self) -> usize {
        self.counts.iter().map(|(_, count)| count.field.bytes_needed()).max().unwrap_or(0)
    }

    /// Hands out every taxel with its count, or none of them.
    ///
    /// # Errors
    /// [`TooShort`] if the frame ends before one of its numbers does.
    pub fn read(&self, frame: &Frame, mut each: impl FnMut(u16, u16)) -> Result<(), TooShort> {
        let (found, needed) = (frame.bytes().len(), self.bytes_needed());
        if found < needed {
            return Err(TooShort { id: frame.id, found, needed });
        }
        for (taxel, count) in &self.counts {
            if let Some(count) = count.read(frame.bytes()) {
                each(*taxel, count);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bits::ByteOrder;

    fn count(length_bits: u16, signed: bool, low: i64, shift: u8, top: u16) -> CountField {
        CountField { field: BitField::new(0, length_bits, ByteOrder::Little, signed).unwrap(), low, shift, top }
    }

    #[test]
    fn signed_and_long_numbers_become_counts_from_zero_on() {
        let signed = count(12, true, -2048, 0, 4095);
        assert_eq!([[0, 8], [0, 0], [0xFF, 7]].map(|bytes| signed.read(&bytes)), [Some(0), Some(2048), Some(4095)]);
        let long = count(24, false, 0, 8, u16::MAX);
        assert_eq!(long.read(&[0xFF, 0x34, 0x12]), Some(0x1234));
        let window = count(24, false, 8_000_000, 0, 20_000);
        let at = |number: u32| window.read(&number.to_le_bytes());
        assert_eq!(
            [at(7_999_999), at(8_000_123), at(8_100_000)],
            [Some(0), Some(123), Some(20_000)],
            "rails at both ends"
        );
        assert_eq!(window.read(&[0, 0]), None);
    }
}
