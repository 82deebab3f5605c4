//! A number somewhere in the bytes of a frame: the one decoder for every signal that is described by its place.

use thiserror::Error;

use crate::frame::{CanId, FD_BYTES, Frame, FrameKind};

/// Bits of the longest frame.
const FRAME_BITS: u16 = 8 * FD_BYTES as u16;

/// Which end of a number comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ByteOrder {
    /// Least significant byte first ("Intel" in DBC files).
    #[default]
    Little,
    /// Most significant byte first ("Motorola" in DBC files).
    Big,
}

/// Where a number lies in a frame.
///
/// `start_bit` counts as DBC files do: bit n is bit n % 8 of byte n / 8, where bit 0 of a byte is its least
/// significant. It names the number's *least* significant bit in little endian and its *most* significant bit in big
/// endian. So 16 bits in bytes 2 and 3 start at 16 in little endian, at 23 in big endian; 12 bits of big endian that
/// fill byte 0 and the upper half of byte 1 start at 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BitField {
    /// First bit in the order in which the bits follow each other: from the frame's first sent bit in big endian, from
    /// the lowest bit of the first byte in little endian.
    first: u16,
    length_bits: u16,
    byte_order: ByteOrder,
    signed: bool,
}

/// Why a number cannot lie where it is said to.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum PlaceError {
    /// No number, or one of more bits than can be read.
    #[error("length is {length_bits} bits, expected 1 to 64")]
    Length {
        /// The length.
        length_bits: u16,
    },
    /// The number sticks out of the longest frame.
    #[error("{length_bits} bits from start bit {start_bit} ({byte_order:?} endian) do not fit into 64 bytes")]
    OutsideFrame {
        /// First bit, as DBC files count.
        start_bit: u16,
        /// Width.
        length_bits: u16,
        /// Which end comes first.
        byte_order: ByteOrder,
    },
}

impl BitField {
    /// # Errors
    /// [`PlaceError`] unless the number has 1 to 64 bits and lies within 64 bytes.
    pub fn new(start_bit: u16, length_bits: u16, byte_order: ByteOrder, signed: bool) -> Result<Self, PlaceError> {
        if !(1..=64).contains(&length_bits) {
            return Err(PlaceError::Length { length_bits });
        }
        let first = match byte_order {
            ByteOrder::Little => start_bit,
            ByteOrder::Big => start_bit ^ 7,
        };
        if first > FRAME_BITS - length_bits {
            return Err(PlaceError::OutsideFrame { start_bit, length_bits, byte_order });
        }
        Ok(Self { first, length_bits, byte_order, signed })
    }

    /// Its bits in the frame, from the first on: two numbers of one byte order that share none do not overlap.
    pub fn bits(self) -> impl Iterator<Item = u16> {
        // As DBC files count, so that both byte orders are comparable.
        (self.first..self.first + self.length_bits).map(move |bit| match self.byte_order {
            ByteOrder::Little => bit,
            ByteOrder::Big => bit ^ 7,
        })
    }

    /// How many bytes a frame needs to hold it.
    #[must_use]
    pub const fn bytes_needed(self) -> usize {
        (self.first + self.length_bits).div_ceil(8) as usize
    }

    /// Smallest and largest number.
    #[must_use]
    pub const fn range(self) -> (i128, i128) {
        let span = 1_i128 << self.length_bits;
        if self.signed { (-(span / 2), span / 2 - 1) } else { (0, span - 1) }
    }

    /// The number; `None` if the bytes end before it does. Bytes after it may hold anything.
    #[must_use]
    pub fn read(self, bytes: &[u8]) -> Option<i128> {
        let (covered, shift) = (bytes.get(self.covered())?, self.shift());
        let word = match self.byte_order {
            ByteOrder::Little => covered.iter().rev().fold(0, |word, byte| word << 8 | i128::from(*byte)),
            ByteOrder::Big => covered.iter().fold(0, |word, byte| word << 8 | i128::from(*byte)),
        };
        let bits = word >> shift & self.mask();
        Some(if bits > self.range().1 { bits - (1 << self.length_bits) } else { bits })
    }

    /// Writes the low bits of `number` and leaves all others; false if the bytes end before it does.
    pub fn write(self, number: i128, bytes: &mut [u8]) -> bool {
        let (covered, shift, mask) = (self.covered(), self.shift(), self.mask());
        let Some(covered) = bytes.get_mut(covered) else { return false };
        let (set, keep) = ((number & mask) << shift, !(mask << shift));
        let last = covered.len() - 1;
        for (place, byte) in covered.iter_mut().enumerate() {
            let at = match self.byte_order {
                ByteOrder::Little => 8 * place,
                ByteOrder::Big => 8 * (last - place),
            };
            *byte = (*byte & (keep >> at & 0xFF) as u8) | (set >> at & 0xFF) as u8;
        }
        true
    }

    /// The bytes that it has bits in: nine at most.
    fn covered(self) -> std::ops::Range<usize> {
        usize::from(self.first / 8)..self.bytes_needed()
    }

    /// How far its lowest bit lies above that of the covered bytes.
    const fn shift(self) -> u32 {
        match self.byte_order {
            ByteOrder::Little => (self.first % 8) as u32,
            ByteOrder::Big => (8 * self.bytes_needed()) as u32 - (self.first + self.length_bits) as u32,
        }
    }

    const fn mask(self) -> i128 {
        (1 << self.length_bits) - 1
    }
}

/// A selector of a multiplexed frame: the frame is meant where its number is among some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selector {
    /// The selecting number.
    pub field: BitField,
    /// First and last of each run of numbers that select, in order and with a number that does not between two.
    pub values: Vec<(i128, i128)>,
}

/// Which frames are meant: an identifier, and for multiplexed ones what selects them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameMatch {
    /// The identifier.
    pub id: CanId,
    /// All of these must select; empty for a frame that is not multiplexed.
    pub selectors: Vec<Selector>,
}

impl FrameMatch {
    /// Whether a frame is meant. One that ends before a selector is not.
    #[must_use]
    pub fn is(&self, frame: &Frame) -> bool {
        let selects = |selector: &Selector| {
            let number = selector.field.read(frame.bytes());
            number.is_some_and(|number| selector.values.iter().any(|(first, last)| (*first..=*last).contains(&number)))
        };
        frame.id == self.id
            && matches!(frame.kind, FrameKind::Data | FrameKind::Fd)
            && self.selectors.iter().all(selects)
    }

    /// Whether `other` means every frame that this means.
    #[must_use]
    pub fn is_within(&self, other: &Self) -> bool {
        let held = |wide: &Selector| {
            self.selectors.iter().any(|narrow| narrow.field == wide.field && narrow.is_within(&wide.values))
        };
        self.id == other.id && other.selectors.iter().all(held)
    }

    /// Whether no frame is meant by both.
    #[must_use]
    pub fn excludes(&self, other: &Self) -> bool {
        let apart = |a: &Selector| other.selectors.iter().any(|b| a.field == b.field && a.excludes(b));
        self.id != other.id || self.selectors.iter().any(apart)
    }
}

impl Selector {
    fn is_within(&self, wide: &[(i128, i128)]) -> bool {
        self.values.iter().all(|(first, last)| wide.iter().any(|(low, high)| low <= first && last <= high))
    }

    /// Whether no number selects by both.
    #[must_use]
    pub fn excludes(&self, other: &Self) -> bool {
        let meets = |(a, b): &(i128, i128), (c, d): &(i128, i128)| a <= d && c <= b;
        !self.values.iter().any(|run| other.values.iter().any(|also| meets(run, also)))
    }
}

#[cfg(test)]
mod tests;
