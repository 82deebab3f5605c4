//! Numbers that are described by their place in a frame: pressures, taxels, selectors.

use taxel_skin::Kilopascal;
use taxel_wire::array::{CountField, FrameSpec};
use taxel_wire::bits::{BitField, ByteOrder, FrameMatch, Selector};
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalError, SignalSpec};
use taxel_wire::{FD_BYTES, Frame};

use crate::bytes::Bytes;

const UNITS: [PressureUnit; 5] =
    [PressureUnit::Pascal, PressureUnit::Kilopascal, PressureUnit::Bar, PressureUnit::Millibar, PressureUnit::Psi];

/// A description, and frames that it may be of.
pub fn run(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let spec = spec(&mut bytes);
    let (low, shift, top) = (i64::from_le_bytes(bytes.array()), bytes.byte(), bytes.word());
    match BitField::new(spec.start_bit, spec.length_bits, spec.byte_order, spec.signed) {
        Ok(field) => {
            check_place(field);
            let count = CountField { field, low, shift, top };
            while !bytes.is_empty() {
                if let Some(frame) = bytes.frame() {
                    check_number(field, &frame);
                    check_counts(count, &frame);
                    check_pressure(&spec, &frame);
                }
            }
        }
        Err(problem) => {
            assert!(!problem.to_string().is_empty());
            assert!(spec.validate().is_err());
        }
    }
}

fn spec(bytes: &mut Bytes<'_>) -> SignalSpec {
    let [kind, unit] = bytes.array();
    let ambient_kpa = if kind & 8 != 0 { bytes.double() } else { 101.325 };
    SignalSpec {
        id: bytes.id(kind & 1 != 0),
        start_bit: bytes.word(),
        length_bits: u16::from(bytes.byte()),
        byte_order: if kind & 2 != 0 { ByteOrder::Big } else { ByteOrder::Little },
        signed: kind & 4 != 0,
        scale: bytes.double(),
        offset: bytes.double(),
        unit: UNITS[usize::from(unit) % UNITS.len()],
        meaning: if kind & 16 != 0 {
            PressureMeaning::AbsoluteBag { ambient_kpa }
        } else {
            PressureMeaning::Differential
        },
    }
}

/// Within the longest frame, as many bits as it says, none of them twice.
fn check_place(field: BitField) {
    let mut taken = [false; 8 * FD_BYTES];
    let mut bits = 0;
    for bit in field.bits() {
        assert!(!std::mem::replace(&mut taken[usize::from(bit)], true), "{field:?} has bit {bit} twice");
        bits += 1;
    }
    let (low, high) = field.range();
    assert_eq!(high - low + 1, 1_i128 << bits);
    let last = taken.iter().rposition(|taken| *taken).unwrap_or_default();
    assert_eq!(field.bytes_needed(), last / 8 + 1);
}

/// What is read is in the range, and what is written is read and changes nothing else.
fn check_number(field: BitField, frame: &Frame) {
    let Some(number) = field.read(frame.bytes()) else {
        assert!(frame.bytes().len() < field.bytes_needed());
        return;
    };
    let (low, high) = field.range();
    assert!((low..=high).contains(&number), "{field:?}: {number}");
    let mut changed = frame.bytes().to_vec();
    assert!(field.write(number, &mut changed));
    assert_eq!(changed, frame.bytes());
    assert!(field.write(!number, &mut changed));
    assert_eq!(field.read(&changed), Some(if low < 0 { !number } else { high - number }));
    let differ: u32 = changed.iter().zip(frame.bytes()).map(|(a, b)| (a ^ b).count_ones()).sum();
    assert_eq!(differ as usize, field.bits().count(), "each of its bits and no other");
}

/// All taxels of a frame or none, each within its range, and a frame is meant by what is in it.
fn check_counts(count: CountField, frame: &Frame) {
    let values = count.field.read(frame.bytes()).map(|number| (number, number));
    let selectors = vec![Selector { field: count.field, values: values.into_iter().collect() }];
    let frames = FrameMatch { id: frame.id, selectors };
    let spec = FrameSpec { counts: vec![(3, count), (7, count)], frames };
    let mut seen = Vec::new();
    match spec.read(frame, |taxel, count| seen.push((taxel, count))) {
        Ok(()) => {
            assert_eq!(seen.iter().map(|(taxel, _)| *taxel).collect::<Vec<_>>(), [3, 7]);
            assert!(seen.iter().all(|(_, found)| *found <= count.top));
        }
        Err(short) => {
            assert!(seen.is_empty() && short.found < short.needed && short.to_string().contains("expected"));
            assert!(!spec.frames.is(frame), "what cannot be read selects nothing");
        }
    }
}

/// A pressure is finite, and what is sent for it is read as the same but for rounding.
fn check_pressure(spec: &SignalSpec, frame: &Frame) {
    // Of its own identifier, which no mutation would hit often.
    let frame = Frame::new(spec.id, frame.kind, frame.bytes()).expect("as many bytes as before");
    let Ok(pressure) = spec.decode(&frame) else { return };
    assert!(spec.validate().is_ok() && pressure.0.is_finite());
    match spec.encode(pressure) {
        Ok(sent) => {
            let read = spec.decode(&sent).expect("what was sent is read");
            let difference = (read.0 - pressure.0).abs();
            assert!(difference <= rounding(spec, pressure, read), "{spec:?}: {pressure:?} came as {read:?}");
        }
        // At an end of the range rounding may leave it.
        Err(error) => assert!(matches!(error, SignalError::Overflow { .. }), "{error}"),
    }
}

/// Half a step, and what doubles of the sizes that were added cannot hold.
fn rounding(spec: &SignalSpec, pressure: Kilopascal, read: Kilopascal) -> f64 {
    let ambient = if let PressureMeaning::AbsoluteBag { ambient_kpa } = spec.meaning { ambient_kpa } else { 0.0 };
    let offset = spec.unit.to_kilopascal(spec.offset).abs();
    let sizes = pressure.0.abs() + read.0.abs() + ambient + offset;
    0.5 * spec.unit.to_kilopascal(spec.scale).abs() + 1e-12 * sizes + f64::MIN_POSITIVE
}
