//! Which signal is which taxel of a device that is described by its signals, as a number in its line: `signals 5f3a9c12`.
//!
//! Signals in another order make the models those of other taxels, and nothing at rest would tell. Frames count by their
//! order, so that a device of the same make at other identifiers is the same; as with skin boards, it may be new electronics
//! on the same pads.

use taxel_wire::CanId;
use taxel_wire::array::FrameSpec;
use taxel_wire::bits::{BitField, FrameMatch};

use crate::fnv::Fnv;

/// Where the taxels of a device lie in these frames; `None` without any.
pub fn signals(frames: &[FrameSpec]) -> Option<String> {
    let mut order: Vec<Vec<u8>> = frames.iter().map(|spec| key(&spec.frames)).collect();
    order.sort_unstable();
    order.dedup(); // the counts of one frame may be written in several places
    let place = |spec: &FrameSpec| order.binary_search(&key(&spec.frames)).unwrap_or(usize::MAX);
    let taxels = frames.iter().flat_map(|spec| spec.counts.iter().map(move |(taxel, count)| (*taxel, spec, count)));
    let mut taxels: Vec<_> = taxels.collect();
    taxels.sort_by_key(|(taxel, ..)| *taxel);
    let mut hash = Fnv::default();
    for (taxel, spec, count) in &taxels {
        hash.push(&taxel.to_le_bytes());
        hash.push(&(place(spec) as u64).to_le_bytes());
        hash.push(&place_of(count.field));
    }
    (!taxels.is_empty()).then(|| format!("signals {:08x}", hash.sum()))
}

/// Orders frames by their identifiers, and those of one by what tells them apart.
fn key(frames: &FrameMatch) -> Vec<u8> {
    let (extended, id) = match frames.id {
        CanId::Standard(id) => (0, u32::from(id)),
        CanId::Extended(id) => (1, id),
    };
    let mut key = vec![extended];
    key.extend(id.to_be_bytes());
    for selector in &frames.selectors {
        key.extend(place_of(selector.field));
        for &(low, high) in &selector.values {
            // Shifted, so that their bytes are in the order of the numbers.
            key.extend([low, high].map(|number| number.wrapping_sub(i128::MIN).to_be_bytes()).concat());
        }
    }
    key
}

/// Its bits in their order, and whether the number has a sign.
fn place_of(field: BitField) -> Vec<u8> {
    let signed = u8::from(field.range().0 < 0);
    field.bits().flat_map(u16::to_le_bytes).chain([signed, u8::MAX]).collect()
}

#[cfg(test)]
mod tests {
    use taxel_wire::array::CountField;
    use taxel_wire::bits::{ByteOrder, Selector};

    use super::*;

    /// Two frames of two taxels each at these identifiers, told apart by their first byte too; the first taxel lies at `bit`.
    fn frames(ids: [u32; 2], values: [i128; 2], bit: u16) -> Vec<FrameSpec> {
        let at = |start| BitField::new(start, 16, ByteOrder::Little, false).unwrap();
        let count = |start| CountField { field: at(start), low: 0, shift: 0, top: u16::MAX };
        let selected =
            |value| Selector { field: BitField::new(0, 8, ByteOrder::Little, false).unwrap(), values: vec![value] };
        let frame = |n: usize, bits: [u16; 2]| FrameSpec {
            frames: FrameMatch { id: CanId::Extended(ids[n]), selectors: vec![selected((values[n], values[n]))] },
            counts: (0..2).map(|k| (2 * n as u16 + k, count(bits[usize::from(k)]))).collect(),
        };
        vec![frame(0, [bit, 24]), frame(1, [8, 24])]
    }

    #[test]
    fn a_device_at_other_identifiers_is_the_same_and_one_with_other_signals_is_not() {
        let of = |ids, values, bit| signals(&frames(ids, values, bit));
        let known = of([10, 11], [0, 0], 8);
        assert_eq!(known, of([50, 61], [0, 0], 8), "the order of its frames is the same");
        assert_ne!(known, of([11, 10], [0, 0], 8), "each taxel lies in the other frame");
        assert_ne!(known, of([10, 11], [0, 0], 40), "one lies elsewhere");
        let multiplexed = of([10, 10], [1, 2], 8);
        assert_eq!(multiplexed, known, "what tells its frames apart is another, and their order is the same");
        assert_ne!(multiplexed, of([10, 10], [2, 1], 8));
        assert_ne!(of([10, 10], [-1, 2], 8), of([10, 10], [2, -1], 8), "numbers may have a sign");
        let mut turned = frames([10, 11], [0, 0], 8);
        turned.reverse();
        assert_eq!(signals(&turned), known, "in whichever order they are written");
        let (mut split, first) = (frames([10, 11], [0, 0], 8), frames([10, 11], [0, 0], 8).remove(0));
        split[0].counts.truncate(1);
        split.push(FrameSpec { counts: first.counts[1..].to_vec(), ..first });
        assert_eq!(signals(&split), known, "one frame, written in two places");
        assert_eq!(signals(&[]), None);
        assert_eq!(known.as_deref(), Some("signals 8c440209"), "sets on disk have it");
        let mut signed = frames([10, 11], [0, 0], 8);
        signed[0].counts[0].1.field = BitField::new(8, 16, ByteOrder::Little, true).unwrap();
        assert_ne!(signals(&signed), known, "a number with a sign is another");
    }
}
