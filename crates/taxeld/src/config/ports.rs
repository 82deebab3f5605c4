//! Patches and gauges whose values come over ports of YARP.

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::{BoardAddress, BusIndex};
use taxel_wire::signal::{ByteOrder, PressureMeaning, PressureUnit, SignalSpec};
use taxel_yarp::{Content, GAUGE_STEP, GaugeRow, NameServer, Rows, gauge_signal_id};

use super::file::{BusSection, BusSource, Config};
use super::patch_section::{GaugeSection, PatchSection};
use super::problem::Faults;

/// Gives each patch on a robot's name server a bus of its own: behind the ports are many CAN buses, whose boards have the same
/// addresses.
pub fn expand(config: &mut Config) {
    for position in 0..config.bus.len() {
        let bus = config.bus[position].clone();
        if bus.source != BusSource::Yarp {
            continue;
        }
        for patch in config.patch.iter_mut().filter(|patch| patch.bus == bus.name).skip(1) {
            patch.bus = format!("{}/{}", bus.name, patch.name);
            config.bus.push(BusSection { name: patch.bus.clone(), ..bus.clone() });
        }
    }
}

/// Notes what is wrong with a bus.
pub fn check_bus(bus: &BusSection, faults: &mut Faults) {
    match (&bus.server, bus.source == BusSource::Yarp) {
        (Some(server), true) => drop(faults.take("server", NameServer::at(server))),
        (Some(_), false) => faults.note("server", "server: it is of a bus with source = \"yarp\""),
        (None, _) => {}
    }
}

/// Notes what is wrong with the port of a patch.
pub fn check_patch(section: &PatchSection, bus: &BusSection, faults: &mut Faults) {
    let is_yarp = bus.source == BusSource::Yarp;
    match &section.port {
        None if is_yarp => {
            let words =
                format!("bus `{}` has source = \"yarp\": expected port = \"/icub/skin/{}\"", bus.name, section.name);
            faults.note("", words);
        }
        Some(_) if !is_yarp => {
            faults.note("port", format!("port needs a bus with source = \"yarp\", and `{}` has none", bus.name));
        }
        Some(port) => check_name("port", port, faults),
        None => {}
    }
    if section.port_boards.is_some() && section.port.is_none() {
        faults.note("port_boards", "port_boards: it tells the order of the boards in a port, and there is no port");
    }
    if section.port.is_none() {
        return;
    }
    if section.boards.is_empty() {
        faults.note("", "a port has the counts of boards: expected boards");
    }
    for (position, board) in section.boards.iter().enumerate() {
        if board.sets_something() {
            let words = "nothing can be set at boards that are read by a port: leave board_type, no_load, shift and cdc_offset out";
            faults.note(&format!("boards[{position}]"), words);
        }
        if section.port_boards.as_ref().is_some_and(|order| !order.contains(&board.address)) {
            faults.note("port_boards", format!("port_boards: board {} is not among them", board.address));
        }
    }
}

/// The signal of a gauge on a port, of the patch at this position.
pub fn gauge(section: &GaugeSection, port: &str, patch: usize, faults: &mut Faults) -> Option<SignalSpec> {
    check_name("gauge.port", port, faults);
    if section.id.is_some() || section.signal.is_some() {
        faults.note("gauge", "gauge: port is there, so that id and signal say nothing: leave them out");
    }
    let named = section.unit.as_deref().and_then(PressureUnit::named);
    let words = || format!("gauge.unit: expected the unit of the port's values, one of {}", PressureUnit::NAMES);
    let unit = faults.take("gauge.unit", named.ok_or_else(words))?;
    Some(SignalSpec {
        id: gauge_signal_id(patch),
        start_bit: 0,
        length_bits: 64,
        byte_order: ByteOrder::Little,
        signed: true,
        scale: GAUGE_STEP,
        offset: 0.0,
        unit,
        meaning: section
            .ambient_kpa
            .map_or(PressureMeaning::Differential, |ambient_kpa| PressureMeaning::AbsoluteBag { ambient_kpa }),
    })
}

/// What is on the ports of a bus.
pub fn of_bus(config: &Config, plan: &Plan, bus: BusIndex) -> Vec<(String, Content)> {
    let mut ports = Vec::new();
    for (section, plan) in config.patch.iter().zip(&plan.patches) {
        if let Some(port) = section.port.as_ref().filter(|_| plan.patch.is_on(bus)) {
            ports.push((port.clone(), Content::Skin(rows(section, plan))));
        }
    }
    for (position, (section, plan)) in config.patch.iter().zip(&plan.patches).enumerate() {
        let gauge = section.gauge.as_ref().filter(|_| plan.gauge.as_ref().is_some_and(|gauge| gauge.bus == bus));
        if let Some((port, gauge)) = gauge.and_then(|gauge| Some((gauge.port.clone()?, gauge))) {
            let row = GaugeRow { id: gauge_signal_id(position), index: gauge.index.unwrap_or(0) };
            ports.push((port, Content::Gauge(row)));
        }
    }
    ports
}

fn rows(section: &PatchSection, plan: &PatchPlan) -> Rows {
    let of_patch = || plan.patch.boards().iter().map(|board| board.address).collect();
    let stated = |order: &Vec<u8>| order.iter().filter_map(|address| BoardAddress::new(*address).ok()).collect();
    let order: Vec<_> = section.port_boards.as_ref().map_or_else(of_patch, stated);
    let boards = plan.patch.boards();
    let triangles = boards.iter().flat_map(|board| board.modules.iter().map(|(module, _)| (board.address, *module)));
    Rows::new(&order, &triangles.collect::<Vec<_>>())
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
        [[patch]]\nname = \"left\"\nbus = \"robot\"\nport = \"/icub/skin/left_forearm\"\nboards = [{ address = 12, modules = \"0\" }]\n\
        port_boards = [13, 12]\ngauge = { port = \"/bag:o\", index = 2, unit = \"mbar\" }\n\
        [[patch]]\nname = \"right\"\nbus = \"robot\"\nport = \"/icub/skin/right_forearm\"\nboards = [{ address = 12, modules = \"0\" }]\n";

    /// Left and right have the same addresses: they are on two buses of the engine.
    #[test]
    fn each_patch_of_a_robot_has_a_bus_with_its_ports() {
        let (config, scene) = examine_text(Path::new("t.toml"), ROBOT).unwrap();
        let names: Vec<_> = config.bus.iter().map(|bus| bus.name.as_str()).collect();
        assert_eq!(names, ["robot", "robot/right"]);
        let ports =
            |bus| of_bus(&config, &scene.plan, BusIndex(bus)).into_iter().map(|(port, _)| port).collect::<Vec<_>>();
        assert_eq!(ports(0), ["/icub/skin/left_forearm", "/bag:o"]);
        assert_eq!(ports(1), ["/icub/skin/right_forearm"]);
        let left = &scene.plan.patches[0];
        assert!(!left.configures() && left.live.stale_after == 8 * left.period);
    }

    /// What the port of the gauge makes is what its signal reads.
    #[test]
    fn the_pressure_of_a_port_is_that_of_its_frames() {
        let (config, scene) = examine_text(Path::new("t.toml"), ROBOT).unwrap();
        let Some((_, mut content)) = of_bus(&config, &scene.plan, BusIndex(0)).pop() else { panic!("no gauge") };
        let mut frames: Vec<TimedFrame> = Vec::new();
        content.take(Time::default(), b"1 2 -125.5", &mut frames).unwrap();
        let signal = scene.plan.patches[0].gauge.as_ref().unwrap().signal;
        assert!((signal.decode(&frames[0].frame).unwrap().0 + 12.55).abs() < 1e-6);
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
            ("[13, 12]", "[13, 11]", "board 12 is not among them"),
            ("unit = \"mbar\"", "unit = \"mm\"", "expected the unit of the port's values"),
            ("index = 2", "id = 3", "id and signal say nothing"),
            ("source = \"yarp\"", "source = \"yarp\"\nserver = \"here\"", "expected ADDRESS:PORT"),
        ];
        for (from, to, says) in cases {
            let said = refused(from, to);
            assert!(said.contains(says), "{to}: {said}");
        }
    }
}
