use std::path::Path;

use taxel_engine::plan::PatchPlan;
use taxel_wire::signal::PressureMeaning;

use super::super::examine_text;
use super::*;

const SKIN: &str =
    "[store]\npath = \"t.db\"\n[[bus]]\nname = \"c\"\ninterface = \"can0\"\n[[bus]]\nname = \"p\"\nsource = \"push\"\n";
const BOARD: &str = "boards = [{ address = 12, modules = \"0\" }]";

fn with(gauge: &str) -> String {
    format!("{SKIN}[[patch]]\nname = \"a\"\nbus = \"c\"\n{BOARD}\ngauge = {{ {gauge} }}\n")
}

fn plan(gauge: &str) -> PatchPlan {
    examine_text(Path::new("t.toml"), &with(gauge)).unwrap().1.plan.patches[0].clone()
}

fn refused(text: &str) -> String {
    examine_text(Path::new("t.toml"), text).unwrap_err().to_string()
}

/// What a gauge that says `value` comes to, kPa.
fn read(gauge: &str, value: f64) -> f64 {
    plan(gauge).gauge.unwrap().signal.decode(&reading::frame(0, value)).unwrap().0
}

#[test]
fn a_line_is_a_bus_of_its_own_with_the_unit_of_its_template() {
    let gauge = "line = \"/dev/ttyACM0\", template = \"P={mbar}\", baud = 9600, poll = \"P\\r\", every_ms = 100";
    let (config, scene) = examine_text(Path::new("t.toml"), &with(gauge)).unwrap();
    let (bus, plan) = (config.bus.last().unwrap(), &scene.plan.patches[0]);
    let line = line_of(&config, bus).unwrap();
    assert_eq!((bus.name.as_str(), line.baud), ("/dev/ttyACM0", 9_600));
    assert!(matches!(&line.speech, Speech::Text { poll, .. } if poll == "P\r"), "{line:?}");
    assert_eq!((line.every, plan.gauge.as_ref().unwrap().bus), (Duration::from_millis(100), BusIndex(2)));
    assert!((read(gauge, 305.0) - 30.5).abs() < 1e-9 && plan.has_gauge());
}

#[test]
fn what_a_reading_refers_to_is_said_or_below_ambient() {
    let line = "line = \"tcp:h:1\", template = \"{kPa}\"";
    assert_eq!(read(line, 30.0), 30.0);
    assert_eq!(read(&format!("{line}, reference = \"below_ambient\""), 30.0), 30.0);
    assert_eq!(read(&format!("{line}, reference = \"ambient\""), -30.0), 30.0);
    assert!((read(&format!("{line}, reference = \"absolute\""), 71.325) - 30.0).abs() < 1e-9);
    assert!((read(&format!("{line}, ambient_kpa = 95.0"), 65.0) - 30.0).abs() < 1e-9);
    let takes = |more: &str| plan(&format!("{line}{more}")).gauge.unwrap().takes_ambient;
    let all = ["", ", reference = \"ambient\"", ", reference = \"absolute\"", ", ambient_kpa = 95.0"].map(takes);
    assert_eq!(all, [false, false, true, false], "only a guess is put right by the vented bag");
}

#[test]
fn a_gauge_on_can_may_be_absolute_without_a_known_ambient_pressure() {
    let gauge = plan("id = 0x200, signal = \"0|32@1-\", unit = \"Pa\", reference = \"absolute\"").gauge.unwrap();
    assert!(gauge.takes_ambient && gauge.signal.meaning == PressureMeaning::AbsoluteBag { ambient_kpa: AMBIENT_KPA });
}

#[test]
fn a_gauge_that_is_pushed_is_a_bus_of_its_own() {
    let (config, scene) = examine_text(Path::new("t.toml"), &with("push = true")).unwrap();
    let gauge = scene.plan.patches[0].gauge.as_ref().unwrap();
    assert!(gauge.pushed && config.bus[usize::from(gauge.bus.0)].source == BusSource::Push);
}

#[test]
fn a_register_is_read_as_rtu_on_a_device_and_over_tcp_on_a_host() {
    for (at, framing) in [("/dev/ttyUSB0", Framing::Rtu), ("tcp:10.0.0.7:502", Framing::Tcp)] {
        let gauge =
            format!("modbus = \"{at}\", register = 18, input = true, number = \"u16\", scale = 0.1, unit = \"kPa\"");
        let (config, _) = examine_text(Path::new("t.toml"), &with(&gauge)).unwrap();
        let register = Register { slave: 1, input: true, address: 18, number: Number::U16, scale: 0.1 };
        assert_eq!(line_of(&config, config.bus.last().unwrap()).unwrap().speech, Speech::Modbus(register, framing));
    }
}

#[test]
fn two_patches_in_one_bag_share_a_line_if_they_say_the_same_of_it() {
    let other = "[[patch]]\nname = \"b\"\nbus = \"c\"\nboards = [{ address = 13, modules = \"0\" }]\ngauge = { ";
    let line = "line = \"/dev/ttyACM0\", template = \"{kPa}\"";
    let text = |more: &str| format!("{}{other}{line}{more} }}\n", with(line));
    let scene = examine_text(Path::new("t.toml"), &text("")).unwrap().1;
    let buses: Vec<_> = scene.plan.patches.iter().map(|plan| plan.gauge.as_ref().unwrap().bus).collect();
    assert_eq!(buses, [BusIndex(2); 2]);
    assert!(refused(&text(", baud = 9600")).contains("patch `b` reads it otherwise"), "{}", text(""));
}

#[test]
fn what_is_wrong_with_a_gauge_is_said_with_what_was_expected() {
    let line = "line = \"/dev/ttyACM0\"";
    for (gauge, says) in [
        (format!("{line}"), "gauge.template is missing: what a line looks like, as in \"P={kPa}\""),
        (format!("{line}, template = \"P=\""), "gauge.template = \"P=\": it has no number"),
        (format!("{line}, template = \"{{ksi}}\""), "{ksi} is no unit"),
        (format!("{line}, template = \"{{kPa}}\", baud = 1"), "gauge.baud = 1: expected one of 1200, 2400"),
        (format!("{line}, template = \"{{kPa}}\", unit = \"Pa\""), "gauge.unit: the template has the unit"),
        (format!("{line}, template = \"{{kPa}}\", every_ms = 50"), "without poll nothing is asked"),
        (
            format!("{line}, template = \"{{kPa}}\", poll = \"P\", every_ms = 500"),
            "gauge.every_ms = 500: expected 10 to 200",
        ),
        (format!("{line}, template = \"{{kPa}}\", poll = \"\""), "gauge.poll: expected 1 to 64 bytes"),
        (format!("{line}, template = \"{{kPa}}\", id = 3"), "id and signal and line say two things"),
        (format!("{line}, template = \"{{kPa}}\", bus = \"c\""), "a line is a bus of its own"),
        ("modbus = \"tcp:h:502\", unit = \"kPa\"".to_owned(), "gauge.register is missing"),
        ("modbus = \"tcp:h:502\", register = 1".to_owned(), "gauge.unit: expected the unit of the register's steps"),
        (
            "modbus = \"tcp:h:502\", register = 1, unit = \"kPa\", number = \"f64\"".to_owned(),
            "expected one of u16, i16",
        ),
        (
            "modbus = \"tcp:h:502\", register = 1, unit = \"kPa\", poll = \"P\"".to_owned(),
            "gauge.poll: it belongs to line",
        ),
        ("line = \"COM3\", template = \"{kPa}\"".to_owned(), "gauge.line = \"COM3\": expected a device"),
        ("line = \"tcp:h:1\", template = \"{kPa}\", baud = 9600".to_owned(), "over TCP has none"),
        ("template = \"{kPa}\"".to_owned(), "nothing says where its number is"),
        ("push = true, unit = \"Pa\"".to_owned(), "gauge.unit: the pressure comes with each message"),
        ("id = 1, signal = \"0|8@1+\", unit = \"Pa\", baud = 9600".to_owned(), "gauge.baud: it belongs to line"),
        ("push = true, reference = \"absolute\"".to_owned(), "gauge.reference: the pressure comes with each message"),
        (
            format!("{line}, template = \"{{kPa}}\", reference = \"ambient\", ambient_kpa = 99.0"),
            "with reference = \"absolute\"",
        ),
    ] {
        let said = refused(&with(&gauge));
        assert!(said.contains(says), "{gauge}: {said}");
    }
    let pushed = format!(
        "{SKIN}[[patch]]\nname = \"a\"\nbus = \"p\"\npush = {{ taxels = 4 }}\narea_mm2 = 1.0\ngauge = {{ push = true }}\n"
    );
    assert!(refused(&pushed).contains("and the pressure with them: write gauge = {}"), "{}", refused(&pushed));
}
