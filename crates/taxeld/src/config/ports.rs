//! Patches and gauges whose values come over ports of YARP.

use std::collections::BTreeSet;

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::BusIndex;
use taxel_wire::reading::{self, INDEX_MAX};
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};
use taxel_yarp::{Content, NameServer, Rows};

use super::file::{BusSection, BusSource, Config};
use super::patch_section::{GaugeSection, PatchSection};
use taxel_rig::Faults;

/// Gives each port of a robot's name server a bus of its own: behind the ports are many CAN buses, whose boards have the same
/// addresses, and a gauge that is heard says nothing of a skin.
pub fn expand(config: &mut Config) {
    for position in 0..config.bus.len() {
        let (bus, mut is_taken) = (config.bus[position].clone(), false);
        if bus.source != BusSource::Yarp {
            continue;
        }
        let buses = &mut config.bus;
        let mut own = |name: String| {
            if !std::mem::replace(&mut is_taken, true) {
                return bus.name.clone();
            }
            if buses.iter().all(|known| known.name != name) {
                buses.push(BusSection { name: name.clone(), ..bus.clone() });
            }
            name
        };
        for patch in &mut config.patch {
            let is_on = |name: &Option<String>| name.as_ref().unwrap_or(&patch.bus) == &bus.name;
            let gauge = patch.gauge.as_mut().filter(|gauge| gauge.port.is_some() && is_on(&gauge.bus));
            if patch.bus == bus.name {
                patch.bus = own(format!("{}/{}", bus.name, patch.name));
            }
            if let Some(gauge) = gauge {
                gauge.bus = Some(own(format!("{}{}", bus.name, gauge.port.as_deref().unwrap_or_default())));
            }
        }
    }
}

/// Notes what is wrong with a bus.
pub fn check_bus(bus: &BusSection, faults: &mut Faults) {
    let Some(server) = &bus.server else { return };
    faults.require("server", bus.source == BusSource::Yarp, || ": it is of a bus with source = \"yarp\"");
    faults.take("server", NameServer::of(Some(server)));
}

/// Notes what is wrong with the port of a patch.
pub fn check_patch(section: &PatchSection, bus: &BusSection, faults: &mut Faults) {
    let (name, is_yarp) = (&bus.name, bus.source == BusSource::Yarp);
    let Some(port) = &section.port else {
        return faults.require("", !is_yarp, || {
            format!("bus `{name}` has source = \"yarp\": expected port = \"/icub/skin/{}\"", section.name)
        });
    };
    faults.require("port", is_yarp, || format!(" needs a bus with source = \"yarp\", and `{name}` has none"));
    check_name("port", port, faults);
    faults.require("", !section.boards.is_empty(), || "a port has the counts of boards: expected boards");
    for (position, board) in section.boards.iter().enumerate() {
        faults.require(&format!("boards[{position}]"), !board.sets_something(), || {
            ": nothing can be set at boards that are read by a port: leave board_type, no_load, shift and cdc_offset out"
        });
    }
}

/// The signal of a gauge on a port.
pub fn gauge(section: &GaugeSection, port: &str, faults: &mut Faults) -> Option<SignalSpec> {
    check_name("gauge.port", port, faults);
    let index = section.index.unwrap_or(0);
    faults.range("gauge.index", index as f64, 0.0, INDEX_MAX as f64);
    let unit = named_unit(section, "port's values", faults)?;
    Some(reading::signal(index, unit, PressureMeaning::Differential))
}

/// The unit of a gauge that does not say it by itself.
pub fn named_unit(section: &GaugeSection, of: &str, faults: &mut Faults) -> Option<PressureUnit> {
    let named = section.unit.as_deref().and_then(PressureUnit::named);
    let words = || format!("gauge.unit: expected the unit of the {of}, one of {}", PressureUnit::NAMES);
    faults.take("gauge.unit", named.ok_or_else(words))
}

/// The port of a bus, and what is on it; none where it is no port.
pub fn of_bus(config: &Config, plan: &Plan, bus: BusIndex) -> Option<(String, Content)> {
    let patches = || config.patch.iter().zip(&plan.patches);
    let skin = patches().find(|(_, plan)| plan.patch.is_on(bus));
    if let Some((port, plan)) = skin.and_then(|(section, plan)| Some((section.port.clone()?, plan))) {
        return Some((port, Content::Skin(Rows::new(&plan.patch))));
    }
    let on_bus = |plan: &PatchPlan| plan.gauge.as_ref().is_some_and(|gauge| gauge.bus == bus);
    let gauges = || patches().filter(|(_, plan)| on_bus(plan)).filter_map(|(section, _)| section.gauge.as_ref());
    let port = gauges().find_map(|gauge| gauge.port.clone())?;
    let indices: BTreeSet<usize> = gauges().map(|gauge| gauge.index.unwrap_or(0)).collect();
    Some((port, Content::Gauge(indices.into_iter().collect())))
}

fn check_name(key: &str, port: &str, faults: &mut Faults) {
    let known = |c: char| c.is_ascii_graphic() && c != '"';
    if !port.starts_with('/') || port.len() > 256 || !port.chars().all(known) {
        faults.note(key, format!("{key} = {port:?}: expected the name of a port, as in \"/icub/skin/left_forearm\""));
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use taxel_skin::{BusIndex, Time};
    use taxel_wire::TimedFrame;

    use super::super::examine_text;
    use super::*;

    const ROBOT: &str = "[store]\npath = \"t.db\"\n[[bus]]\nname = \"robot\"\nsource = \"yarp\"\n\
        [[patch]]\nname = \"left\"\nbus = \"robot\"\nport = \"/icub/skin/left_forearm\"\n\
        boards = [{ address = 13, modules = \"\" }, { address = 12, modules = \"0\" }]\n\
        gauge = { port = \"/bag:o\", index = 2, unit = \"mbar\" }\n\
        [[patch]]\nname = \"right\"\nbus = \"robot\"\nport = \"/icub/skin/right_forearm\"\nboards = [{ address = 12, modules = \"0\" }]\n\
        gauge = { port = \"/bag:o\", unit = \"kPa\" }\n";

    /// Left and right have the same addresses: they are on two buses of the engine.
    #[test]
    fn each_port_of_a_robot_is_a_bus_and_one_gauge_may_be_of_two_patches() {
        let (config, scene) = examine_text(Path::new("t.toml"), ROBOT).unwrap();
        let names: Vec<_> = config.bus.iter().map(|bus| bus.name.as_str()).collect();
        assert_eq!(names, ["robot", "robot/bag:o", "robot/right"]);
        let ports = [0, 1, 2].map(|bus| of_bus(&config, &scene.plan, BusIndex(bus)).unwrap().0);
        assert_eq!(ports, ["/icub/skin/left_forearm", "/bag:o", "/icub/skin/right_forearm"]);
        let left = &scene.plan.patches[0];
        assert!(!left.configures() && left.live.stale_after == 8 * left.period);
    }

    /// What the port of the gauge makes is what its signal reads.
    #[test]
    fn the_pressure_of_a_port_is_that_of_its_frames() {
        let (config, scene) = examine_text(Path::new("t.toml"), ROBOT).unwrap();
        let mut content = of_bus(&config, &scene.plan, BusIndex(1)).unwrap().1;
        let mut frames: Vec<TimedFrame> = Vec::new();
        content.take(Time::default(), b"1 2 -125.5", &mut frames).unwrap();
        let signal = scene.plan.patches[0].gauge.as_ref().unwrap().signal;
        let read: Vec<f64> =
            frames.iter().filter_map(|timed| signal.decode(&timed.frame).ok()).map(|kpa| kpa.0).collect();
        assert!(frames.len() == 2 && read.len() == 1 && (read[0] + 12.55).abs() < 1e-6, "{read:?}");
    }

    #[test]
    fn what_contradicts_a_port_is_named() {
        let refused = |from: &str, to: &str| {
            let text = ROBOT.replacen(from, to, 1);
            examine_text(Path::new("t.toml"), &text).unwrap_err().to_string()
        };
        let cases = [
            ("port = \"/icub/skin/left_forearm\"\n", "", "expected port ="),
            ("source = \"yarp\"", "interface = \"can0\"", "port needs a bus with source = \"yarp\""),
            ("\"/icub/skin/left_forearm\"", "\"left\"", "expected the name of a port"),
            ("modules = \"0\" }", "modules = \"0\", shift = 1 }", "nothing can be set at boards"),
            ("index = 2", "index = 9999", "gauge.index = 9999: expected 0 to 2046"),
            ("port = \"/bag:o\", index", "bus = \"robot\", index", "nothing says where its number is"),
            ("unit = \"mbar\"", "unit = \"mm\"", "expected the unit of the port's values"),
            ("index = 2", "id = 3", "id and signal and port say two things"),
            ("source = \"yarp\"", "source = \"yarp\"\nserver = \"here\"", "expected ADDRESS:PORT"),
        ];
        for (from, to, says) in cases {
            let said = refused(from, to);
            assert!(said.contains(says), "{to}: {said}");
        }
    }
}
