use super::*;
use proptest::prelude::*;

/// A skin of eight taxels in two multiplexed frames, with its gauge, temperature and state.
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
 SG_ Celsius : 16|8@1+ (0.5,-40) [0|100] "degC" Host
 SG_ State : 24|8@1+ (1,0) [0|100] "" Host
 SG_ Analog : 32|32@1- (1,0) [0|100] "kPa" Host

SIG_VALTYPE_ 257 Analog : 1;
"#;

const HEAD: &str = "[[patch]]\nname = \"p\"\nbus = \"b\"\narea_mm2 = 16.0\n[patch.array]\n";

fn expanded(keys: &str, dbc: &str) -> Result<PatchSection, String> {
    let text = format!("store.path = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n{HEAD}{keys}\n");
    let config = crate::config::load::parse(Path::new("t.toml"), &text).unwrap();
    let section = &config.patch[0];
    from_text(section, section.array.as_ref().unwrap(), dbc)
}

#[test]
fn names_become_signals_in_the_order_of_their_numbers() {
    let section =
        expanded("taxels = [\"Skin.T*\"]\ngauge = \"Bag.Pressure\"\ndbc_temperature = \"Bag.Celsius\"", SKIN).unwrap();
    let places: Vec<_> = section.signals.iter().map(|s| (s.mux[0].value, s.start_bit, s.signed)).collect();
    assert_eq!(places, [(0, 4, false), (0, 16, false), (1, 4, false), (1, 16, true)], "T0, T1, T2, T10");
    assert!(section.signals.iter().all(|s| (s.id, s.extended) == (0x18FE_F100, true)));
    let gauge = section.gauge.unwrap();
    assert_eq!((gauge.id, gauge.start_bit, gauge.length_bits, gauge.scale, gauge.offset), (257, 7, 16, 0.5, -1.0));
    assert!(gauge.signed && gauge.byte_order == OrderOfBytes::Big && gauge.unit == UnitWord(PressureUnit::Kilopascal));
    let temperature = section.array.unwrap().temperature.unwrap();
    assert_eq!((temperature.scale, temperature.offset, temperature.number.start_bit), (0.5, -40.0, 16));
}

/// Of an editor that begins files with a byte order mark, and with a unit in Latin-1.
#[test]
fn the_encoding_of_a_file_does_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let (before, after) = SKIN.split_once("degC").unwrap();
    let bytes = ["\u{feff}".as_bytes(), before.as_bytes(), b"\xB0C", after.as_bytes()].concat();
    std::fs::write(folder.path().join("skin.dbc"), bytes).unwrap();
    let text = format!(
        "store.path = \"t.db\"\n[[bus]]\nname = \"b\"\ninterface = \"can0\"\n{HEAD}dbc = \"skin.dbc\"\ntaxels = [\"Skin.T*\"]\n"
    );
    let path = folder.path().join("t.toml");
    let config = crate::config::load::parse(&path, &text).unwrap();
    assert_eq!(expand(&config.patch[0], &path).unwrap().signals.len(), 4);
}

#[test]
fn nested_selectors_and_their_runs_are_followed() {
    let dbc = r#"VERSION ""
NS_ :
BS_:
BU_: Host
BO_ 16 N: 8 Sensor
 SG_ S0 M : 0|8@1+ (1,0) [0|0] "" Host
 SG_ S1 m1M : 8|8@1+ (1,0) [0|0] "" Host
 SG_ X m3 : 16|12@1+ (1,0) [0|0] "" Host

SG_MUL_VAL_ 16 S1 S0 1-2,5-5;
SG_MUL_VAL_ 16 X S1 3-3;
"#;
    let section = expanded("taxels = [\"N.X\"]", dbc).unwrap();
    let mux: Vec<_> = section.signals[0].mux.iter().map(|mux| (mux.start_bit, mux.also.clone())).collect();
    assert_eq!(mux, [(8, vec![[3, 3]]), (0, vec![[1, 2], [5, 5]])]);
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
    let starts = |keys: &str| expanded(keys, dbc).map(|s| s.signals.iter().map(|s| s.start_bit).collect::<Vec<_>>());
    assert_eq!(starts("taxels = [\"ForearmCells.Capacitive*Cell*\"]"), Ok(vec![12, 0]));
    assert_eq!(starts("taxels = [\"ForearmCells.*\"]"), Ok(vec![12, 0, 24]));
    let short = "taxels = [\"ForearmCells_Short.CapacitiveCountsOfTheUpperA_0000\"]";
    assert_eq!(starts(short), Ok(vec![0]), "what is written in the file is a name, too");
}

/// As cantools' issue 506 has it: side by side, and not one within the other.
#[test]
fn all_selectors_of_a_signal_have_to_fit() {
    let dbc = r#"VERSION ""
NS_ :
BS_:
BU_: Host
BO_ 16 N: 8 Sensor
 SG_ Part M : 0|4@1+ (1,0) [0|0] "" Host
 SG_ Row M : 4|4@1+ (1,0) [0|0] "" Host
 SG_ A m0 : 8|12@1+ (1,0) [0|0] "" Host
 SG_ B m0 : 8|12@1+ (1,0) [0|0] "" Host

SG_MUL_VAL_ 16 A Part 1-1;
SG_MUL_VAL_ 16 A Row 0-0;
SG_MUL_VAL_ 16 B Part 2-2;
SG_MUL_VAL_ 16 B Row 0-0;
"#;
    let section = expanded("taxels = [\"N.A\", \"N.B\"]", dbc).unwrap();
    let mux = |n: usize| section.signals[n].mux.iter().map(|mux| (mux.start_bit, mux.value)).collect::<Vec<_>>();
    assert_eq!((mux(0), mux(1)), (vec![(0, 1), (4, 0)], vec![(0, 2), (4, 0)]));
}

#[test]
fn the_advice_about_an_unknown_unit_can_be_followed() {
    let dbc = SKIN.replace("\"kPa\"", "\"ell\"");
    let advised = "gauge = \"Bag.Pressure\"\ngauge_is = { unit = \"kPa\", scale = 0.1 }";
    let gauge = expanded(advised, &dbc).unwrap().gauge.unwrap();
    assert_eq!((gauge.unit, gauge.scale, gauge.offset), (UnitWord(PressureUnit::Kilopascal), 0.1, -1.0));
    let known = expanded("gauge = \"Bag.Pressure\"", &SKIN.replace("kPa", "mmHg")).unwrap().gauge.unwrap();
    assert_eq!(known.unit, UnitWord(PressureUnit::MillimetreMercury));
}

#[test]
fn what_a_dbc_file_cannot_mean_is_refused_with_message_and_signal() {
    let keys = "taxels = [\"Skin.T*\"]";
    for (keys, from, to, expected) in [
        (
            "taxels = [\"Skin.U0\"]",
            "",
            "",
            "no signal is named `Skin.U0` (as `Message.Signal`); the nearest is `Skin.T0`",
        ),
        ("gauge = \"Bag.*\"", "", "", "signal Bag.Analog: it is a floating-point number, expected an integer"),
        ("gauge = \"Skin.T1\"", "", "", "signal Skin.T1: it is multiplexed"),
        (
            "gauge = \"Bag.Pressure\"",
            "\"kPa\"",
            "\"ell\"",
            "signal Bag.Pressure: its unit is \"ell\", which is none of Pa, hPa",
        ),
        (keys, "T1 m0 : 16|12", "T1 m0 : 56|12", "signal Skin.T1: it ends in byte 9, the message has 8"),
        (keys, "T1 m0 : 16|12", "T1 m0 : 16|3", "signal Skin.T1: a taxel of 3 bits, expected 4 to 24"),
        (keys, "2566844672 Skin", "70000 Skin", "signal Skin.T0: identifier 70000 has more than 11 bits"),
        (keys, "T10 m1 : 16", "T1 m1 : 16", "two signals are named `Skin.T1`"),
        (
            "taxels = [\"Skin.T*\"]\ndbc_counter = \"Bag.State\"",
            "",
            "",
            "signal Bag.State: expected a counter of all taxels",
        ),
        (keys, "T10 m1 : 16|12@1-", "T10 M : 32|12@1+", "Sel and T10 are both selectors of its message"),
        (keys, "Sel M :", "Sel :", "signal Skin.T0: it is multiplexed, and no signal of its message is the selector"),
    ] {
        let dbc = SKIN.replace(from, to);
        let why = expanded(keys, if from.is_empty() { SKIN } else { &dbc }).unwrap_err();
        assert!(why.contains(expected), "{keys}: {why}");
    }
}

#[test]
fn patterns_and_names_are_matched_and_sorted_as_people_read_them() {
    assert!(matches(b"Row*.T*", b"Row12.T3") && matches(b"*", b"") && !matches(b"Row*.T", b"Row1.T2"));
    let mut names = ["T10", "T9", "T1", "S2", "T9a"];
    names.sort_by(|a, b| natural(a, b));
    assert_eq!(names, ["S2", "T1", "T9", "T9a", "T10"]);
}

proptest! {
    #[test]
    fn no_damage_to_a_dbc_file_panics(at in 0..SKIN.len(), byte in 0_u8..128) {
        let mut bytes = SKIN.as_bytes().to_vec();
        bytes[at] = byte;
        let _ = expanded("taxels = [\"*\"]\ngauge = \"Bag.Pressure\"", &String::from_utf8(bytes).unwrap());
    }
}
