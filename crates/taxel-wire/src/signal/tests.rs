use super::*;
use proptest::prelude::*;

/// The chamber pressure of the insole recordings: signed, little endian, pascal.
const INSOLE: SignalSpec = SignalSpec {
    id: CanId::Standard(0x3A1),
    start_bit: 0,
    length_bits: 32,
    byte_order: ByteOrder::Little,
    signed: true,
    scale: 1.0,
    offset: 0.0,
    unit: PressureUnit::Pascal,
    meaning: PressureMeaning::Differential,
};

fn frame(bytes: &[u8]) -> Frame {
    Frame::data(INSOLE.id, bytes).unwrap()
}

prop_compose! {
    fn any_place()(first in 0..512_u16, wish in 1..=64_u16, big: bool, signed: bool) -> SignalSpec {
        let length_bits = wish.min(512 - first);
        let (start_bit, byte_order) =
            if big { (first ^ 7, ByteOrder::Big) } else { (first, ByteOrder::Little) };
        SignalSpec { start_bit, length_bits, byte_order, signed, ..INSOLE }
    }
}

fn any_unit() -> impl Strategy<Value = PressureUnit> {
    use PressureUnit::*;
    prop::sample::select(vec![Pascal, Kilopascal, Bar, Millibar, Psi])
}

fn meaning_of(ambient_kpa: Option<f64>) -> PressureMeaning {
    match ambient_kpa {
        Some(ambient_kpa) => PressureMeaning::AbsoluteBag { ambient_kpa },
        None => PressureMeaning::Differential,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4096))]

    #[test]
    fn raw_numbers_survive_the_wire(place in any_place(), unit in any_unit(), bits: u64, absolute: bool) {
        // Up to 40 bits, so that the arithmetic's rounding stays far below half a raw step.
        let length_bits = place.length_bits.min(40);
        let meaning = meaning_of(absolute.then_some(101.325));
        let spec = SignalSpec { length_bits, scale: 0.25, offset: -3.0, unit, meaning, ..place };
        let field = spec.field().unwrap();
        let mut raw = vec![0; field.bytes_needed()];
        assert!(field.write(i128::from(bits), &mut raw));
        let kind = if raw.len() > 8 { FrameKind::Fd } else { FrameKind::Data };
        let sent = Frame::new(spec.id, kind, &raw).unwrap();
        let pressure = spec.decode(&sent).unwrap();
        prop_assert_eq!(spec.encode(pressure).unwrap(), sent);
    }

    #[test]
    fn a_short_frame_is_refused(spec in any_place(), data in prop::collection::vec(any::<u8>(), 0..=64)) {
        let (needed, length) = (spec.field().unwrap().bytes_needed(), data.len());
        let decoded = spec.decode(&Frame::fd(spec.id, &data).unwrap());
        prop_assert_eq!(matches!(decoded, Err(SignalRefusal::Short { .. })), length < needed);
    }
}

#[test]
fn the_insoles_chamber_pressure() {
    assert_eq!(INSOLE.decode(&frame(&[0xCF, 0x16, 0, 0])), Ok(Kilopascal(5.839)));
    assert_eq!(
        INSOLE.decode(&frame(&[0xFE, 0xFF, 0xFF, 0xFF, 7])),
        Ok(Kilopascal(-0.002)),
        "later bytes do not matter"
    );
    assert_eq!(INSOLE.encode(Kilopascal(5.8393)), Ok(frame(&[0xCF, 0x16, 0, 0])), "to the nearest pascal");
}

/// Against NIST SP 811, appendix B.8, which rounds to seven digits.
#[test]
fn every_unit_has_its_factor_and_is_known_by_its_name() {
    let pascal = [
        ("Pa", 1.0),
        ("hPa", 1e2),
        ("kPa", 1e3),
        ("MPa", 1e6),
        ("bar", 1e5),
        ("mbar", 1e2),
        ("PSI", 6.894_757e3),
        ("mmHg", 1.333_224e2),
        ("inHg", 3.386_389e3),
        ("Torr", 1.333_224e2),
        ("mmH2O", 9.806_65),
        ("cmH2O", 98.0665),
        ("inH2O", 249.0889),
        ("atm", 101_325.0),
        ("kgf/cm2", 98_066.5),
    ];
    assert_eq!(PressureUnit::NAMES.split(", ").count(), pascal.len());
    for ((name, pascal), known) in pascal.into_iter().zip(PressureUnit::NAMES.split(", ")) {
        let unit = PressureUnit::named(name).unwrap();
        assert_eq!(PressureUnit::named(known), Some(unit));
        let kpa = unit.to_kilopascal(1.0);
        assert!((kpa * 1e3 / pascal - 1.0).abs() < 3e-7, "{name}: {kpa} kPa");
        assert!((unit.from_kilopascal(kpa) - 1.0).abs() < 1e-15, "{name}");
    }
    assert_eq!(PressureUnit::Torr.to_kilopascal(760.0), 101.325);
    assert_eq!((PressureUnit::named("furlong"), PressureUnit::named("mPa")), (None, None));
}

#[test]
fn faulty_specs_are_named() {
    let faults = [
        (SignalSpec { id: CanId::Standard(0x800), ..INSOLE }, "identifier 800 is too large, expected at most 7FF"),
        (
            SignalSpec { id: CanId::Extended(0x2000_0000), ..INSOLE },
            "identifier 20000000 is too large, expected at most 1FFFFFFF",
        ),
        (SignalSpec { length_bits: 65, ..INSOLE }, "length is 65 bits, expected 1 to 64"),
        (SignalSpec { scale: 0.0, ..INSOLE }, "scale is 0, expected a finite number other than 0"),
        (SignalSpec { offset: f64::NAN, ..INSOLE }, "offset is NaN, expected a finite number"),
        (
            SignalSpec { meaning: PressureMeaning::AbsoluteBag { ambient_kpa: f64::INFINITY }, ..INSOLE },
            "ambient pressure is inf kPa, expected a finite number above 0",
        ),
    ];
    for (spec, message) in faults {
        assert_eq!(spec.validate().unwrap_err().to_string(), message);
    }
    assert_eq!(INSOLE.validate(), Ok(()));
}

#[test]
fn what_does_not_fit_is_refused() {
    let byte = SignalSpec { length_bits: 8, signed: true, unit: PressureUnit::Kilopascal, ..INSOLE };
    assert!(byte.encode(Kilopascal(127.4)).is_ok() && byte.encode(Kilopascal(-128.4)).is_ok());
    let refused = byte.encode(Kilopascal(127.6)).unwrap_err();
    assert_eq!(refused.to_string(), "127.6 kPa needs the raw number 128, expected -128 to 127");
    assert!(byte.encode(Kilopascal(f64::NAN)).is_err());
    assert!(byte.encode(Kilopascal(f64::NEG_INFINITY)).is_err());
}

#[test]
fn other_frames_are_refused() {
    let other = Frame::data(CanId::Extended(0x3A1), &[0; 4]).unwrap();
    assert!(matches!(INSOLE.decode(&other), Err(SignalRefusal::NotThisSignal { .. })));
    let remote = Frame::new(INSOLE.id, FrameKind::Remote, &[0; 4]).unwrap();
    assert_eq!(INSOLE.decode(&remote), Err(SignalRefusal::Kind(FrameKind::Remote)));
    let extended = SignalSpec { id: CanId::Extended(0x40), ..INSOLE };
    let error = Frame::new(CanId::Extended(0x40), FrameKind::Error, &[0; 8]).unwrap();
    assert!(
        matches!(extended.decode(&error), Err(SignalRefusal::NotThisSignal { .. })),
        "class bits are no identifier"
    );
    let huge = SignalSpec { scale: f64::MAX, ..INSOLE };
    assert!(matches!(huge.decode(&frame(&[0xFF, 0xFF, 0, 0])), Err(SignalRefusal::NotFinite { raw: 0xFFFF, .. })));
}
