use super::*;
use proptest::prelude::*;

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

/// `START|LENGTH@ORDER SIGN` as in a DBC file.
fn field(start_bit: u16, length_bits: u16, order: u8, sign: char) -> BitField {
    let byte_order = if order == 1 { ByteOrder::Little } else { ByteOrder::Big };
    BitField::new(start_bit, length_bits, byte_order, sign == '-').unwrap()
}

/// What cantools 45.1 encoded.
#[test]
fn what_cantools_encodes_is_decoded() {
    let fd = format!("236145{}ffe00000907800", "00".repeat(54));
    let golden: [(&str, &[(BitField, i128)]); 7] = [
        (
            "c0ab230100000000",
            &[(field(0, 4, 1, '+'), 0), (field(4, 12, 1, '+'), 0xABC), (field(16, 12, 1, '+'), 0x123)],
        ),
        ("f1ffff0f00000000", &[(field(0, 4, 1, '+'), 1), (field(4, 12, 1, '+'), 4095), (field(16, 12, 1, '-'), -1)]),
        ("1100000800000000", &[(field(4, 12, 1, '+'), 1), (field(16, 12, 1, '-'), -2048)]),
        (
            "abcffe03e87ff400",
            &[
                (field(7, 12, 0, '+'), 0xABC),
                (field(11, 12, 0, '-'), -2),
                (field(31, 16, 0, '+'), 1000),
                (field(46, 13, 0, '-'), -3),
            ],
        ),
        ("000020c0e8ff0000", &[(field(35, 13, 1, '-'), -3)]),
        (
            &fd,
            &[
                (field(0, 12, 1, '+'), 0x123),
                (field(12, 12, 1, '+'), 0x456),
                (field(463, 12, 0, '-'), -2),
                (field(492, 12, 1, '+'), 0x789),
            ],
        ),
        ("0503010000000000", &[(field(0, 8, 1, '+'), 5), (field(8, 8, 1, '+'), 3), (field(16, 12, 1, '+'), 1)]),
    ];
    for (hex, numbers) in golden {
        for (field, number) in numbers {
            assert_eq!(field.read(&bytes(hex)), Some(*number), "{hex} {field:?}");
        }
    }
}

/// `S1 m1M` selects `X m3`, and `SG_MUL_VAL_` says that S1 itself is there for 1, 2 and 5.
#[test]
fn a_frame_is_meant_where_all_its_selectors_select() {
    let frame = |hex: &str| Frame::data(CanId::Standard(0x10), &bytes(hex)).unwrap();
    let outer = Selector { field: field(0, 8, 1, '+'), values: vec![(1, 2), (5, 5)] };
    let inner = Selector { field: field(8, 8, 1, '+'), values: vec![(3, 3)] };
    let meant = FrameMatch { id: CanId::Standard(0x10), selectors: vec![outer, inner] };
    assert!(meant.is(&frame("0503010000000000")) && meant.is(&frame("0203")));
    assert!(!meant.is(&frame("0303")) && !meant.is(&frame("0504")));
    assert!(!meant.is(&frame("05")), "it ends before the second selector");
    let other = Frame::data(CanId::Extended(0x10), &bytes("0503")).unwrap();
    assert!(!meant.is(&other), "another identifier");
    let remote = Frame::new(CanId::Standard(0x10), FrameKind::Remote, &bytes("0503")).unwrap();
    assert!(!meant.is(&remote));
}

#[test]
fn a_place_that_no_frame_has_is_refused_with_its_figures() {
    let new = |start_bit, length_bits, byte_order| BitField::new(start_bit, length_bits, byte_order, false);
    assert!(new(0, 0, ByteOrder::Little).is_err() && new(0, 65, ByteOrder::Little).is_err());
    assert!(new(504, 8, ByteOrder::Little).is_ok() && new(511, 8, ByteOrder::Big).is_ok());
    let outside = new(505, 8, ByteOrder::Little).unwrap_err();
    assert_eq!(outside.to_string(), "8 bits from start bit 505 (Little endian) do not fit into 64 bytes");
    assert!(new(510, 8, ByteOrder::Big).is_err() && new(u16::MAX, 64, ByteOrder::Big).is_err());
}

/// Reads the number bit by bit, as the DBC format words it.
fn bit_by_bit(start_bit: u16, length_bits: u16, order: ByteOrder, signed: bool, data: &[u8]) -> i128 {
    let bit_at = |position: u16| i128::from(data[usize::from(position / 8)] >> (position % 8) & 1);
    let (mut value, mut position) = (0, start_bit);
    for n in 0..length_bits {
        match order {
            ByteOrder::Little => value |= bit_at(start_bit + n) << n,
            ByteOrder::Big => {
                value = value << 1 | bit_at(position);
                position = if position.is_multiple_of(8) { position + 15 } else { position - 1 };
            }
        }
    }
    if signed && value >> (length_bits - 1) & 1 == 1 { value - (1 << length_bits) } else { value }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn any_place_in_any_bytes_is_read_or_refused(
        start_bit: u16, length_bits in 0..70_u16, big: bool, signed: bool,
        data in prop::collection::vec(any::<u8>(), 0..80), number: i64,
    ) {
        let order = if big { ByteOrder::Big } else { ByteOrder::Little };
        let Ok(field) = BitField::new(start_bit % 600, length_bits, order, signed) else { return Ok(()) };
        let read = field.read(&data);
        prop_assert_eq!(read.is_some(), data.len() >= field.bytes_needed());
        let Some(read) = read else { return Ok(()) };
        prop_assert_eq!(read, bit_by_bit(start_bit % 600, length_bits, order, signed, &data));
        let (min, max) = field.range();
        prop_assert!((min..=max).contains(&read));
        let mut written = data.clone();
        prop_assert!(field.write(i128::from(number), &mut written));
        let mask = (1_i128 << length_bits) - 1;
        prop_assert_eq!(field.read(&written).unwrap() & mask, i128::from(number) & mask);
        let mine: Vec<u16> = field.bits().collect();
        for bit in (0..data.len() as u16 * 8).filter(|bit| !mine.contains(bit)) {
            let at = |bytes: &[u8]| bytes[usize::from(bit / 8)] >> (bit % 8) & 1;
            prop_assert_eq!(at(&data), at(&written), "bit {} is not its own", bit);
        }
    }
}
