//! A pressure that came as text or as a number, over no CAN bus: as the frame that a gauge on a bus would have sent. So
//! recordings, replays and the engine need not know where it came from.

use crate::bits::ByteOrder;
use crate::frame::{CanId, Frame};
use crate::signal::{PressureMeaning, PressureUnit, SignalSpec};

/// A step of the whole number in the frame, in the unit of the reading: below what any gauge can tell.
pub const STEP: f64 = 1e-6;
/// Of several readings that come together, the last that has an identifier.
pub const INDEX_MAX: usize = 0x7FE;

/// The identifier of the reading at this place, from 0.
#[must_use]
pub fn id(index: usize) -> CanId {
    CanId::Standard(index.min(INDEX_MAX) as u16 + 1)
}

/// The frame of a reading: a signed whole number of 64 bits, little endian. What no number can be saturates; the engine knows
/// what no pressure can be.
#[must_use]
pub fn frame(index: usize, value: f64) -> Frame {
    Frame::of(id(index), ((value / STEP).round() as i64).to_le_bytes())
}

/// The signal that reads such frames.
#[must_use]
pub fn signal(index: usize, unit: PressureUnit, meaning: PressureMeaning) -> SignalSpec {
    SignalSpec {
        id: id(index),
        start_bit: 0,
        length_bits: 64,
        byte_order: ByteOrder::Little,
        signed: true,
        scale: STEP,
        offset: 0.0,
        unit,
        meaning,
    }
}
