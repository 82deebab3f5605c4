use super::*;
use crate::modbus::Request;
use crate::talk::{Speech, Talk};

const MICRO: &str = SHIPPED[0].1;
const ALICAT: &str = SHIPPED[1].1;
const EPICK: &str = SHIPPED[2].1;
const VG10: &str = SHIPPED[3].1;
const ANALOGUE: &str = SHIPPED[4].1;

fn read(text: &str) -> Result<Profile, String> {
    let mut faults = Faults::default();
    let file = toml::from_str(text).map_err(|error| error.to_string())?;
    let words = |faults: Faults| faults.found().into_iter().map(|(_, words)| words).collect::<Vec<_>>().join("\n");
    Profile::new(file, None, &mut faults).ok_or_else(|| words(faults))
}

fn of(text: &str) -> Profile {
    read(text).unwrap()
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

/// A board that answers `OK`, or nothing, to what it is told, and has its set point asked for.
#[test]
fn a_set_point_is_read_back_by_a_line_of_its_own() {
    let told = [("set {kPa} {ms}", "SET {mbar}"), ("ok set {kPa}", "OK"), ("ok vent", "OK")];
    let board = told.iter().fold(MICRO.to_owned(), |text, (from, to)| text.replace(from, to));
    let board = board.replace("hold = ", "set_point = \"SP?\"\nset_point_answer = \"SP={mbar} {*}\"\nhold = ");
    let asks = |board: &str, order: Order| -> Vec<String> {
        let asked = |question: Question| question.words().join(" ");
        of(board).questions(order).into_iter().map(asked).collect()
    };
    let set = ["\"SET 123.45\\n\" \"OK\"", "\"SP?\\n\" \"SP={mbar} {*}\"", "\"get\\n\" \"p {kPa}\""];
    assert_eq!(asks(&board, Order::Set(12.345)), set);
    assert_eq!(asks(&board, Order::Vent), ["\"vent\\n\" \"OK\"", set[2]]);
    let question = &of(&board).questions(Order::Set(12.345))[1];
    assert!(question.judge(Some(123.5)).is_ok());
    assert_eq!(question.judge(Some(100.0)).unwrap_err(), "received set point 100, expected 123.45");
    let silent = board.replace("set_answer = \"OK\"", "").replace("vent_answer = \"OK\"", "");
    let set = "\"SET 123.45\\nSP?\\n\" \"SP={mbar} {*}\"";
    assert_eq!(asks(&silent, Order::Set(12.345)), [set, "\"get\\n\" \"p {kPa}\""]);
    assert_eq!(asks(&silent, Order::Vent)[0], "\"vent\\nSP?\\n\" \"SP={mbar} {*}\"");
    let json = board.replace("SET {mbar}", "{\\\"set\\\": {mbar}}");
    assert_eq!(sent(&of(&json), Order::Set(1.0)), "{\"set\": 10.00}\n");
}

#[test]
fn what_was_sent_received_and_expected_is_said() {
    let question = of(MICRO).questions(Order::Vent).remove(0);
    let missed = |came: &str| {
        let said = Talk::begin(true).take(&question.speech, came.as_bytes()).pop();
        question.missed(came.as_bytes(), said.and_then(Result::err).as_deref())
    };
    assert!(
        missed("").starts_with("sent \"vent\\n\", received nothing, expected \"ok vent\" (text.vent_answer); is it on")
    );
    let words =
        "sent \"vent\\n\", received \"OK\", expected \"ok vent\"; if what came is right, change text.vent_answer";
    assert!(missed("OK\r\n").starts_with(words), "{}", missed("OK\r\n"));
    assert!(missed("vent\r\n").contains("received \"vent\\r\\n\", expected \"ok vent\""), "an echo is shown");
    let question = of(EPICK).questions(Order::Set(20.0)).remove(0);
    let words = "sent [2816, 80, 0] to register 1000 of slave 9, received nothing, expected that it took them";
    assert!(question.missed(&[], None).starts_with(words), "{}", question.missed(&[], None));
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
    assert!(question.judge(Some(2400.0)).unwrap_err().contains("received set point 2400, expected 2500.00"));
}

#[test]
fn what_is_wrong_with_a_profile_is_said() {
    let at = |text: &str, changes: &[(&str, &str, &str)]| {
        for (from, to, says) in changes {
            assert!(text.contains(from), "{from}");
            let error = read(&text.replace(from, to)).unwrap_err();
            assert!(error.contains(says), "{to}: {error}");
        }
    };
    at(
        MICRO,
        &[
            ("set = \"set {kPa} {ms}\"", "set = \"set\"", "expected the set point once"),
            ("set = \"set {kPa} {ms}\"", "set = \"{kPa} {Pa}\"", "expected the set point once"),
            ("set_answer = \"ok set {kPa}\"", "set_answer = \"ok\"", "text.set_answer = \"ok\": it has no number"),
            ("own_limit_s = 2.0", "", "own_limit_s: expected with"),
            ("own_limit_s = 2.0", "own_limit_s = 0.1", "own_limit_s = 0.1: expected 0.5 to 30"),
            ("highest_kpa = 75.0", "highest_kpa = 120.0", "highest_kpa = 120: expected 6 to 95"),
            ("vent = \"vent\"", "vent = \"\"", "vent = \"\": expected one line"),
            ("vent = \"vent\"", "vent = \"vent {kPa}\"", "text.vent = \"vent {kPa}\": expected no braces"),
            ("vent_answer = \"ok vent\"", "", "text.vent_answer is missing"),
            ("vent_answer = \"ok vent\"", "vent_answer = \"vent\"", "an echo of vent is no answer"),
            (
                "pressure_answer = \"p {kPa}\"",
                "pressure_answer = \"p {*}\"",
                "pressure_answer = \"p {*}\": it has no number",
            ),
            ("pressure = \"get\"", "set_point = \"get\"", "text.set_point_answer is missing"),
            ("hold = \"hold {ms}\"", "", "hold and hold_answer"),
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
            ("step_kpa = 1.0", "step_kpa = 0.0", "modbus.step_kpa = 0: expected"),
        ],
    );
    let all = [
        ("reference = \"below", "ambient_kpa = 1.0\nreference = \"below"),
        ("set = \"set {kPa}", "set = \"{x}"),
        ("= 75.0", "= 1.0"),
    ];
    let error = read(&all.iter().fold(MICRO.to_owned(), |text, (from, to)| text.replace(from, to))).unwrap_err();
    assert_eq!(error.lines().count(), 3, "{error}");
}
