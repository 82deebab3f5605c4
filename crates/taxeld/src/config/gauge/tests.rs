use std::path::Path;

use taxel_engine::plan::PatchPlan;
use taxel_rig::modbus::{Number, Request};

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
    // In single quotes of TOML an escape is two characters.
    for poll in ["\"P\\r\"", "'P\\r'"] {
        let gauge = &format!("line = \"/dev/ttyACM0@9600\", template = \"P={{mbar}}\", poll = {poll}");
        let (config, scene) = examine_text(Path::new("t.toml"), &with(gauge)).unwrap();
        let (bus, plan) = (config.bus.last().unwrap(), &scene.plan.patches[0]);
        let line = line_of(&config, bus).unwrap();
        assert_eq!(line.at, At::Serial("/dev/ttyACM0".into(), 9_600));
        assert!(matches!(&line.speech, Speech::Text { poll, .. } if poll == "P\r"), "{line:?}");
        assert_eq!(plan.gauge.as_ref().unwrap().bus, BusIndex(2));
        assert!((read(gauge, 305.0) - 30.5).abs() < 1e-9 && plan.has_gauge());
    }
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
fn a_dial_has_no_bus_and_its_resolution_is_an_uncertainty() {
    let plan = plan("typed = true, resolution_kpa = 0.5, offset_uncertainty_kpa = 0.1");
    assert!(plan.session.typed && plan.gauge.is_none() && plan.can_calibrate() && !plan.has_gauge());
    assert!((plan.fit.gauge.offset_kpa - 0.1_f64.hypot(0.5 / 12.0_f64.sqrt())).abs() < 1e-12);
    let both = format!("{}session = {{ branches = \"both\" }}\n", with("typed = true, resolution_kpa = 0.5"));
    assert!(refused(&both).contains("a dial is typed while the pressure rises"), "{}", refused(&both));
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
        let gauge = format!("line = \"{at}\", register = \"input 18 u16 x0.1\", unit = \"kPa\"");
        let (config, _) = examine_text(Path::new("t.toml"), &with(&gauge)).unwrap();
        let register = Register { slave: 1, input: true, address: 18, number: Number::U16, scale: 0.1 };
        assert_eq!(
            line_of(&config, config.bus.last().unwrap()).unwrap().speech,
            Speech::Modbus(Request::Read(register), framing)
        );
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
    assert!(refused(&text(", poll = \"P\"")).contains("patch `b` reads it otherwise"), "{}", text(""));
}

#[test]
fn what_is_wrong_with_a_gauge_is_said_with_what_was_expected() {
    let line = "line = \"/dev/ttyACM0\"";
    for (gauge, says) in [
        (line.to_owned(), "gauge: expected one of template"),
        (format!("{line}, template = \"P=\""), "gauge.template = \"P=\": it has no number"),
        (format!("{line}, template = \"{{kPa}}\", register = \"holding 1\""), "gauge: expected one of template"),
        (
            format!("{line}, template = \"{{kPa}}\", unit = \"Pa\""),
            "gauge.unit: it belongs to id and signal or port, and the pressure comes by line",
        ),
        (format!("{line}, template = \"{{kPa}}\", id = 3"), "id and signal and line say two things"),
        (format!("{line}, template = \"{{kPa}}\", bus = \"c\""), "a line is a bus of its own"),
        (format!("{line}, register = \"18\", unit = \"kPa\""), "gauge.register = \"18\": expected \"holding 18\""),
        (format!("{line}, register = \"holding 18\""), "gauge.unit: expected the unit of the register's steps"),
        ("line = \"COM3\", template = \"{kPa}\"".to_owned(), "gauge.line = \"COM3\": expected a device"),
        ("template = \"{kPa}\"".to_owned(), "nothing says where its number is"),
        (
            "push = true, unit = \"Pa\"".to_owned(),
            "gauge.unit: it belongs to id and signal or port, and the pressure comes by push",
        ),
        ("id = 1, signal = \"0|8@1+\", unit = \"Pa\", poll = \"P\"".to_owned(), "gauge.poll: it belongs to line"),
        (
            "push = true, reference = \"absolute\"".to_owned(),
            "gauge.reference: it belongs to id and signal or port or line, and the pressure comes by push",
        ),
        ("typed = true".to_owned(), "gauge.resolution_kpa is missing"),
        ("typed = true, resolution_kpa = 9.0".to_owned(), "gauge.resolution_kpa = 9: expected 0.01 to 5"),
        ("typed = true, resolution_kpa = 0.5, id = 3".to_owned(), "id and signal and typed say two things"),
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
