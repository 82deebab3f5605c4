use super::*;
use crate::modbus::Request;
use crate::talk::{Speech, Talk};

const MICRO: &str = include_str!("../../../../deploy/rigs/micro.toml");
const ALICAT: &str = include_str!("../../../../deploy/rigs/alicat.toml");
const EPICK: &str = include_str!("../../../../deploy/rigs/epick.toml");
const VG10: &str = include_str!("../../../../deploy/rigs/vg10.toml");
const ANALOGUE: &str = include_str!("../../../../deploy/rigs/analogue.toml");

fn of(text: &str) -> Profile {
    Profile::new(text, None).unwrap()
}

/// What is sent for an order.
fn sent(profile: &Profile, order: Order) -> String {
    let question = &profile.questions(order)[0];
    String::from_utf8(Talk::begin(true).question(&question.speech)).unwrap()
}

/// Whether a line answers an order.
fn is_answer(profile: &Profile, order: Order, line: &str) -> bool {
    let question = &profile.questions(order)[0];
    let said = Talk::begin(true).take(&question.speech, format!("{line}\r\n").as_bytes());
    said.into_iter().any(|said| said.and_then(|number| question.judge(number)).is_ok())
}

/// What is asked over Modbus.
fn requests(profile: &Profile, order: Order) -> Vec<Request> {
    let request = |question: Question| match question.speech {
        Speech::Modbus(request, _) => request,
        Speech::Text { .. } => panic!("{question:?}"),
    };
    profile.questions(order).into_iter().map(request).collect()
}

fn write(slave: u8, address: u16, values: &[u16]) -> Request {
    Request::Write { slave, address, values: values.to_vec() }
}

#[test]
fn a_set_point_goes_out_in_the_drives_unit_and_is_read_back() {
    let micro = of(MICRO);
    assert_eq!(sent(&micro, Order::Set(12.345)), "set 12.35 2000\n");
    assert!(is_answer(&micro, Order::Set(12.345), "ok set 12.35"));
    for other in ["ok set 12.30", "ok set", "ok vent", ""] {
        assert!(!is_answer(&micro, Order::Set(12.345), other), "{other}");
    }
    assert!(is_answer(&micro, Order::Vent, "ok vent") && !is_answer(&micro, Order::Vent, "ok hold"));
    let alicat = of(ALICAT);
    assert_eq!(sent(&alicat, Order::Set(12.0)), "AS-12.00\r");
    assert!(is_answer(&alicat, Order::Set(12.0), "A -011.93 -012.00"));
    assert!(!is_answer(&alicat, Order::Set(12.0), "A -012.00 -011.00"), "the pressure is there, the set point is not");
    assert!(!is_answer(&alicat, Order::Set(12.0), "?"));
}

#[test]
fn absolute_numbers_and_other_units_are_converted() {
    let text = MICRO
        .replace("set = \"set {kPa} {ms}\"", "set = \"P{mbar}\"")
        .replace("\"below_ambient\"", "\"absolute\"\nambient_kpa = 100.0");
    let profile = of(&text.replace("ok set {kPa}", "P={mbar}"));
    assert_eq!(sent(&profile, Order::Set(20.0)), "P800.00\n");
    assert!(is_answer(&profile, Order::Set(20.0), "P=800.00") && !is_answer(&profile, Order::Set(20.0), "P=200.00"));
}

#[test]
fn what_the_drives_own_gauge_reads_is_below_ambient() {
    for (text, line, kpa) in [(MICRO, "p 20.5", 20.5), (ALICAT, "A -020.50 +000.00", 20.5)] {
        let question = of(text).questions(Order::Vent).pop().unwrap();
        let said = Talk::begin(true).take(&question.speech, format!("{line}\r").as_bytes()).pop();
        assert_eq!(question.judge(said.unwrap().unwrap()), Ok(Some(kpa)), "{line}");
    }
    let question = of(EPICK).questions(Order::Vent).pop().unwrap();
    assert_eq!(question.judge(Some(80.0)), Ok(Some(20.0)));
}

#[test]
fn registers_are_written_as_the_drivers_of_others_write_them() {
    // ros2_epick_gripper: action and mode, absolute kPa where 100 is ambient, no time.
    let epick = requests(&of(EPICK), Order::Set(20.4));
    assert_eq!(epick[0], write(9, 1000, &[0x0B00, 80, 0]));
    assert_eq!([epick[1].of(), epick[2].of()], [(9, 2001), (9, 2002)]);
    assert_eq!(requests(&of(EPICK), Order::Vent)[0], write(9, 1000, &[0x0B00, 100, 0]));
    // onrobot-vg: the mode in the higher byte, percent of vacuum in the lower one.
    assert_eq!(requests(&of(VG10), Order::Set(40.53))[0], write(65, 0, &[0x0100 + 40]));
    assert_eq!(requests(&of(VG10), Order::Vent)[0], write(65, 0, &[0]));
    // Millivolts, never beyond what a register holds.
    assert_eq!(requests(&of(ANALOGUE), Order::Set(20.0))[0], write(1, 0, &[2500]));
    assert_eq!(requests(&of(ANALOGUE), Order::Set(-3.0))[0], write(1, 0, &[0]));
    assert!(of(ANALOGUE).questions(Order::Silence).is_empty());
    let question = &of(ANALOGUE).questions(Order::Set(20.0))[1];
    assert!(question.judge(Some(2500.0)).is_ok());
    assert!(question.judge(Some(2400.0)).unwrap_err().contains("set point is 2400 where 2500.00 was sent"));
}

#[test]
fn what_is_wrong_with_a_profile_is_said() {
    let at = |text: &str, changes: &[(&str, &str, &str)]| {
        for (from, to, says) in changes {
            assert!(text.contains(from), "{from}");
            let error = Profile::new(&text.replace(from, to), None).unwrap_err().to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    };
    at(
        MICRO,
        &[
            ("set = \"set {kPa} {ms}\"", "set = \"set\"", "expected the set point once"),
            ("set = \"set {kPa} {ms}\"", "set = \"{kPa} {Pa}\"", "expected the set point once"),
            ("set_answer = \"ok set {kPa}\"", "set_answer = \"ok\"", "set_answer: it has no number"),
            ("own_limit_s = 2.0", "", "own_limit_s: expected with"),
            ("own_limit_s = 2.0", "own_limit_s = 0.1", "own_limit_s = 0.1: expected 0.5 to 30"),
            ("fail_safe = \"own_limit\"", "fail_safe = \"attended\"", "own_limit_s: expected with"),
            ("fail_safe = \"own_limit\"", "fail_safe = \"hope\"", "hope"),
            ("highest_kpa = 75.0", "highest_kpa = 120.0", "highest_kpa = 120: expected 6 to 95"),
            ("vent = \"vent\"", "vent = \"\"", "vent: expected one line"),
            ("name = ", "colour = \"red\"\nname = ", "colour"),
            ("hold = \"hold {ms}\"", "", "hold and hold_answer"),
            ("[text]", "[words]", "words"),
        ],
    );
    at(
        EPICK,
        &[
            ("\"kpa\"", "0", "set: expected the set point once"),
            ("[0x0B00, 100, 0]", "[\"kpa\"]", "vent: \"kpa\" belongs to set"),
            ("[0x0B00, 100, 0]", "[70000]", "expected numbers of 0 to 65535"),
            ("set_point = \"input 2001 low\"", "", "set_point is missing"),
            ("input 2002 high", "coil 3", "pressure = \"coil 3\": expected"),
            ("ambient_kpa = 100.0", "", "ambient_kpa: expected with"),
            ("step_kpa = 1.0", "step_kpa = 0.0", "step_kpa: expected"),
        ],
    );
}
