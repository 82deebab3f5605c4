use super::*;
use proptest::prelude::*;

/// A skin of four taxels in two multiplexed frames, with its gauge and state.
const SKIN: &str = r#"VERSION ""
NS_ :
BS_:
BU_: Host
BO_ 2566844672 Skin: 8 Sensor
 SG_ Sel M : 0|4@1+ (1,0) [0|15] "" Host
 SG_ T0 m0 : 4|12@1+ (1,0) [0|4095] "" Host
 SG_ T1 m0 : 16|12@1+ (1,0) [0|4095] "" Host
 SG_ T10 m1 : 16|12@1- (1,0) [0|4095] "" Host
 SG_ T2 m1 : 4|12@1+ (1,0) [0|4095] "" Host

BO_ 257 Bag: 8 Sensor
 SG_ Pressure : 7|16@0- (0.5,-1) [0|100] "kPa" Host
 SG_ State : 24|8@1+ (1,0) [0|100] "" Host
 SG_ Analog : 32|32@1- (1,0) [0|100] "kPa" Host

SIG_VALTYPE_ 257 Analog : 1;
"#;

/// Start bits of the signals of a pattern.
fn starts(pattern: &str, dbc: &str) -> Result<Vec<u16>, String> {
    let file = DbcFile::new(dbc)?;
    Ok(file.matching(pattern)?.iter().map(|place| bits(place.signal.start_bit)).collect())
}

/// First values of what selects a signal, with the first bit of each selector.
fn selected(name: &str, dbc: &str) -> Vec<(u16, Vec<(i128, i128)>)> {
    let file = DbcFile::new(dbc).unwrap();
    let place = file.one(name).unwrap();
    place.frames.selectors.iter().map(|s| (s.field.bits().next().unwrap(), s.values.clone())).collect()
}

#[test]
fn names_become_signals_in_the_order_of_their_numbers() {
    let file = DbcFile::new(SKIN).unwrap();
    let taxels = file.matching("Skin.T*").unwrap();
    let places: Vec<_> = taxels.iter().map(|t| (t.name, t.signal.start_bit, t.field.range().0 < 0)).collect();
    let expected = [("Skin.T0", 4, false), ("Skin.T1", 16, false), ("Skin.T2", 4, false), ("Skin.T10", 16, true)];
    assert_eq!(places, expected);
    assert!(taxels.iter().all(|taxel| taxel.frames.id == CanId::Extended(0x18FE_F100)));
    assert_eq!(selected("Skin.T2", SKIN), [(0, vec![(1, 1)])]);
    let gauge = file.one("Bag.Pressure").unwrap();
    let signal = gauge.pressure(PressureUnit::Kilopascal);
    assert_eq!((signal.id, signal.start_bit, signal.length_bits), (CanId::Standard(257), 7, 16));
    assert_eq!((signal.scale, signal.offset, signal.byte_order), (0.5, -1.0, ByteOrder::Big));
}

#[test]
fn a_signal_alone_is_written_as_in_a_file() {
    let of = |id: u32, signal: &str| {
        let file = DbcFile::of_signal(id, signal)?;
        let place = file.one("gauge.signal")?;
        let signal = place.pressure(PressureUnit::Pascal);
        let number = (signal.start_bit, signal.length_bits, signal.byte_order, signal.signed);
        Ok::<_, String>((signal.id, number, (signal.scale, signal.offset)))
    };
    let little = (0, 32, ByteOrder::Little, true);
    assert_eq!(of(0x3A1, "0|32@1-"), Ok((CanId::Standard(0x3A1), little, (1.0, 0.0))));
    let big = (7, 16, ByteOrder::Big, false);
    assert_eq!(of(0x18FF_0010, "7|16@0+ (0.5,-1e2)"), Ok((CanId::Extended(0x18FF_0010), big, (0.5, -100.0))));
    assert_eq!(of(0x8000_0010, "0|8@1+").unwrap().0, CanId::Extended(0x10));
    for signal in ["", "0|32", "32@1-", "0|32@2-", "0|32@1-\nBO_ 1 X: 8 D", "a|b@1+", "0|32@1- (1)"] {
        let why = of(1, signal).unwrap_err();
        assert!(why.contains("expected START|LENGTH@ORDER"), "{signal}: {why}");
    }
    assert!(of(0x2000_0000, "0|8@1+").unwrap_err().contains("more than 29 bits"));
    assert!(of(1, "500|32@1+").is_err() && of(1, "0|0@1+").is_err());
}

/// As CANdb++ and cantools write names of more than 32 characters.
#[test]
fn long_names_order_and_name_the_signals() {
    let dbc = r#"VERSION ""
NS_ :
BS_:
BU_: Host
BO_ 16 ForearmCells_Short: 8 Sensor
 SG_ CapacitiveCountsOfTheUpperA_0000 : 0|12@1+ (1,0) [0|0] "" Host
 SG_ CapacitiveCountsOfTheUpperArmCel : 12|12@1+ (1,0) [0|0] "" Host
 SG_ Other : 24|12@1+ (1,0) [0|0] "" Host

BA_DEF_ SG_ "SystemSignalLongSymbol" STRING ;
BA_DEF_ BO_ "SystemMessageLongSymbol" STRING ;
BA_DEF_DEF_ "SystemSignalLongSymbol" "";
BA_DEF_DEF_ "SystemMessageLongSymbol" "";
BA_ "SystemMessageLongSymbol" BO_ 16 "ForearmCells";
BA_ "SystemSignalLongSymbol" SG_ 16 CapacitiveCountsOfTheUpperA_0000 "CapacitiveCountsOfTheUpperArmCell10";
BA_ "SystemSignalLongSymbol" SG_ 16 CapacitiveCountsOfTheUpperArmCel "CapacitiveCountsOfTheUpperArmCell9";
"#;
    assert_eq!(starts("ForearmCells.Capacitive*Cell*", dbc), Ok(vec![12, 0]));
    assert_eq!(starts("ForearmCells.*", dbc), Ok(vec![12, 0, 24]));
    let short = "ForearmCells_Short.CapacitiveCountsOfTheUpperA_0000";
    assert_eq!(starts(short, dbc), Ok(vec![0]), "what is written in the file is a name, too");
}

#[test]
fn what_a_dbc_file_cannot_mean_is_refused_with_message_and_signal() {
    for (name, from, to, expected) in [
        ("Skin.U0", "", "", "no signal is named `Skin.U0` (as `Message.Signal`); the nearest is `Skin.T0`"),
        ("Bag.*", "", "", "signal Bag.Analog: it is a floating-point number, expected an integer"),
        ("Skin.T*", "T1 m0 : 16|12", "T1 m0 : 56|12", "signal Skin.T1: it ends in byte 9, the message has 8"),
        ("Skin.T*", "2566844672 Skin", "70000 Skin", "signal Skin.T0: identifier 70000 has more than 11 bits"),
        ("Skin.T*", "T10 m1 : 16", "T1 m1 : 16", "two signals are named `Skin.T1`"),
        ("Skin.T*", "T10 m1 : 16|12@1-", "T10 M : 32|12@1+", "signal Skin.T0: it has several selectors"),
        (
            "Skin.T*",
            "Sel M :",
            "Sel :",
            "signal Skin.T0: it is multiplexed, and no signal of its message is the selector",
        ),
        ("Skin.T*", "T0 m0 :", "T0 m16 :", "signal Skin.T0: its selector Sel has no number 16"),
        (
            "Skin.T*",
            "SIG_VALTYPE_ 257 Analog : 1;",
            "SG_MUL_VAL_ 2566844672 T1 Sel 0-0,2-2;",
            "signal Skin.T1: it has several",
        ),
        ("*", "VERSION", "VERSIO", "it is no DBC file"),
    ] {
        let dbc = if from.is_empty() { SKIN.to_owned() } else { SKIN.replace(from, to) };
        let why = starts(name, &dbc).unwrap_err();
        assert!(why.contains(expected), "{name}: {why}");
    }
}

proptest! {
    #[test]
    fn no_damage_to_a_dbc_file_panics(at in 0..SKIN.len(), byte in 0_u8..128) {
        let mut bytes = SKIN.as_bytes().to_vec();
        bytes[at] = byte;
        let _ = starts("*", &String::from_utf8(bytes).unwrap());
    }

    #[test]
    fn no_signal_panics(id: u32, text in "[0-9|@+(),. -]{0,20}") {
        let _ = DbcFile::of_signal(id, &text).map(|file| file.one("gauge.signal").map(|_| ()));
    }
}
