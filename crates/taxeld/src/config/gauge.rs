//! Where the pressure of a patch comes from: the one key of `gauge` that says it, and the keys that belong to that one.

use taxel_dbc::DbcFile;
use taxel_engine::plan::Gauge;
use taxel_rig::modbus::{Framing, Register, Request};
use taxel_rig::{Speech, Template};
use taxel_skin::BusIndex;
use taxel_wire::reading;
use taxel_wire::signal::{PressureMeaning, PressureUnit, SignalSpec};

use super::boards::bus_index;
use super::file::{BusSection, BusSource, Config};
use super::patch_section::{BranchesWord, GaugeSection, PatchSection, ReferenceWord};
use super::ports;
use crate::rig::{At, Line, unescaped};
use taxel_rig::Faults;

#[cfg(test)]
mod tests;

/// At sea level. A gauge that reads the bag's own pressure finds out by itself how far the weather is from it.
const AMBIENT_KPA: f64 = 101.325;

/// Where the pressure comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// A frame on a CAN bus.
    Can,
    /// A port of YARP.
    Port,
    /// Text, or a register.
    Line,
    /// A program that pushes it.
    Push,
    /// An operator who reads a dial.
    Typed,
    /// The scans of the patch, which a program pushes.
    Scans,
}

use Kind::{Can, Line as OnLine, Port, Push, Scans, Typed};

impl Kind {
    /// How people write it.
    const fn words(self) -> &'static str {
        match self {
            Can => "id and signal",
            Port => "port",
            OnLine => "line",
            Push => "push",
            Typed => "typed",
            Scans => "push = { taxels = ... } of the patch",
        }
    }
}

/// What says where the pressure of this section comes from: one of them, unless something is wrong, or nothing says it.
fn kinds(section: &GaugeSection) -> Vec<Kind> {
    let said = [
        (Can, section.id.is_some() || section.signal.is_some()),
        (Port, section.port.is_some()),
        (OnLine, section.line.is_some()),
        (Push, section.push),
        (Typed, section.typed),
    ];
    said.into_iter().filter(|(_, is_said)| *is_said).map(|(kind, _)| kind).collect()
}

/// Notes each key that says nothing where the pressure comes from there.
fn check_keys(section: &GaugeSection, kind: Kind, faults: &mut Faults) {
    let keys: [(&str, bool, &[Kind]); 9] = [
        // The bus of what is a bus of its own is known.
        ("bus", section.bus.is_some() && !matches!(kind, OnLine | Push), &[Can, Port]),
        ("index", section.index.is_some(), &[Port]),
        ("unit", section.unit.is_some() && section.register.is_none(), &[Can, Port]),
        ("template", section.template.is_some(), &[OnLine]),
        ("poll", section.poll.is_some(), &[OnLine]),
        ("register", section.register.is_some(), &[OnLine]),
        ("resolution_kpa", section.resolution_kpa.is_some(), &[Typed]),
        ("reference", section.reference.is_some(), &[Can, Port, OnLine]),
        ("ambient_kpa", section.ambient_kpa.is_some(), &[Can, Port, OnLine]),
    ];
    for (key, _, kinds) in keys.into_iter().filter(|(_, is_there, kinds)| *is_there && !kinds.contains(&kind)) {
        let of: Vec<&str> = kinds.iter().map(|kind| kind.words()).collect();
        let (of, by) = (of.join(" or "), kind.words());
        let words = format!("it belongs to {of}, and the pressure comes by {by}: leave it out");
        faults.note(&format!("gauge.{key}"), format!("gauge.{key}: {words}"));
    }
}

/// Gives each line a bus of its own, and each gauge that is pushed.
pub fn expand(config: &mut Config) {
    for patch in &mut config.patch {
        let name = format!("{}/gauge", patch.name);
        let Some(gauge) = &mut patch.gauge else { continue };
        let (name, source) = match kinds(gauge)[..] {
            [OnLine] => (gauge.line.clone().unwrap_or_default(), BusSource::Line),
            [Push] => (name, BusSource::Push),
            _ => continue,
        };
        if config.bus.iter().all(|bus| bus.name != name) {
            config.bus.push(BusSection { name: name.clone(), source, interface: None, server: None, seed: None });
        }
        gauge.bus.get_or_insert(name);
    }
}

/// Whether the pressure comes with the scans of a patch that are pushed: nothing says that it comes from elsewhere.
pub fn comes_with_scans(section: &PatchSection) -> bool {
    section.gauge.as_ref().is_some_and(|gauge| section.push.is_some() && kinds(gauge).is_empty())
}

/// The gauge of a patch. Nothing where the pressure comes with the scans, or where something is wrong, which is noted.
pub fn gauge(
    config: &Config,
    section: &PatchSection,
    (file, bus): (Option<&DbcFile>, Option<BusIndex>),
    faults: &mut Faults,
) -> Option<Gauge> {
    let gauge = section.gauge.as_ref()?;
    let kind = match (&kinds(gauge)[..], section.push) {
        ([kind], _) => *kind,
        ([], Some(_)) => Scans,
        ([], None) => {
            let words = "gauge: nothing says where its number is: id = 0x3A1, signal = \"0|32@1-\" for CAN, or port, line, push = true, or typed = true";
            faults.note("gauge", words);
            return None;
        }
        (several, _) => {
            let said: Vec<&str> = several.iter().map(|kind| kind.words()).collect();
            faults.note("gauge", format!("gauge: {} say two things about where it is: leave one", said.join(" and ")));
            return None;
        }
    };
    check_keys(gauge, kind, faults);
    if kind == Typed {
        dial(section, gauge, faults);
    }
    if matches!(kind, Scans | Typed) {
        return None;
    }
    let of = gauge.bus.as_ref().map_or(bus, |name| bus_index(config, "gauge.bus", name, faults));
    let signal = match kind {
        Port => ports::gauge(gauge, gauge.port.as_deref().unwrap_or_default(), faults)?,
        OnLine => {
            let unit = match line(config, section, faults)?.speech {
                Speech::Text { template, .. } => template.unit(),
                Speech::Modbus(..) => ports::named_unit(gauge, "register's steps", faults),
            }?;
            reading::signal(0, unit, PressureMeaning::Differential)
        }
        Push => reading::signal(0, PressureUnit::Kilopascal, PressureMeaning::Differential),
        Can | Scans | Typed => can(gauge, file, faults)?,
    };
    let of = of?;
    check_bus(kind, (config.bus[usize::from(of.0)].source, section.push.is_some()), faults);
    let (meaning, scale) = refers_to(gauge, faults);
    let signal = SignalSpec { meaning, scale: scale * signal.scale, offset: scale * signal.offset, ..signal };
    faults.take("gauge", signal.validate().map_err(|why| format!("gauge: {why}")))?;
    let takes_ambient = meaning != PressureMeaning::Differential && gauge.ambient_kpa.is_none();
    Some(Gauge { pushed: kind == Push, takes_ambient, ..Gauge::new(of, signal) })
}

/// Notes what is wrong with the bus that it is on.
fn check_bus(kind: Kind, (source, skin_is_pushed): (BusSource, bool), faults: &mut Faults) {
    faults.require(
        "gauge",
        (kind == Port) == (source == BusSource::Yarp),
        || ": one with a port needs a bus with source = \"yarp\", and one without needs another: name it in gauge.bus",
    );
    faults.require(
        "gauge.bus",
        (kind == OnLine) == (source == BusSource::Line),
        || ": a line is a bus of its own, and nothing else is on it: leave it out, or name another",
    );
    faults.require("gauge.bus", kind != Can || source != BusSource::Push, || {
        ": a gauge sends over a CAN bus: name it, or leave id and signal out where the pressure comes with the scans"
    });
    faults.require(
        "gauge.push",
        kind != Push || !skin_is_pushed,
        || ": the scans of this patch are pushed, and the pressure with them: write gauge = {}",
    );
}

/// Checks a dial that is read by eye.
fn dial(section: &PatchSection, gauge: &GaugeSection, faults: &mut Faults) {
    match gauge.resolution_kpa {
        Some(kpa) => drop(faults.range("gauge.resolution_kpa", kpa, 0.01, 5.0)),
        None => faults.note("gauge", "gauge.resolution_kpa is missing: to how many kPa the dial is read, as in 0.5"),
    }
    faults.require(
        "session.branches",
        section.session.branches != BranchesWord::Both,
        || " = \"both\": a dial is typed while the pressure rises: leave it out",
    );
}

/// What the readings are to the pressure on the skin.
fn refers_to(gauge: &GaugeSection, faults: &mut Faults) -> (PressureMeaning, f64) {
    match (gauge.reference, gauge.ambient_kpa) {
        (Some(ReferenceWord::Absolute), ambient_kpa) | (None, ambient_kpa @ Some(_)) => {
            let ambient_kpa = ambient_kpa.unwrap_or(AMBIENT_KPA);
            (PressureMeaning::AbsoluteBag { ambient_kpa }, 1.0)
        }
        (Some(other), ambient_kpa) => {
            faults.require(
                "gauge.ambient_kpa",
                ambient_kpa.is_none(),
                || ": it is of a gauge with reference = \"absolute\": leave it out",
            );
            (PressureMeaning::Differential, if other == ReferenceWord::Ambient { -1.0 } else { 1.0 })
        }
        (None, None) => (PressureMeaning::Differential, 1.0),
    }
}

/// A gauge that prints text or has a register.
fn line(config: &Config, section: &PatchSection, faults: &mut Faults) -> Option<Line> {
    let gauge = section.gauge.as_ref()?;
    let at = gauge.line.as_deref()?;
    let says = |of: &GaugeSection| (of.template.clone(), of.poll.clone(), of.register.clone());
    let same = |other: &GaugeSection| other.line.as_deref() != Some(at) || says(other) == says(gauge);
    if let Some(other) = config.patch.iter().find(|patch| patch.gauge.as_ref().is_some_and(|other| !same(other))) {
        let words =
            format!("gauge.line: patch `{}` reads it otherwise: one gauge has the same keys in both", other.name);
        faults.note("gauge.line", words);
    }
    let at = faults.read("gauge.line", at, At::new(at))?;
    let speech = match (&gauge.template, &gauge.register) {
        (Some(template), None) => {
            let poll = unescaped(gauge.poll.as_deref().unwrap_or_default());
            Speech::Text { poll, template: faults.read("gauge.template", template, Template::new(template))? }
        }
        (None, Some(register)) => {
            let framing = if matches!(at, At::Serial(..)) { Framing::Rtu } else { Framing::Tcp };
            let register = faults.read("gauge.register", register, Register::new(register))?;
            Speech::Modbus(Request::Read(register), framing)
        }
        _ => {
            let words = "gauge: expected one of template, what a line of its text looks like, as in \"P={kPa}\", and register, as in \
                         \"holding 18\"; `taxeld scan --serial` shows what comes";
            faults.note("gauge", words);
            return None;
        }
    };
    Some(Line { at, speech })
}

/// The line of a bus that is one; it was checked.
pub fn line_of(config: &Config, bus: &BusSection) -> Option<Line> {
    let on_it = |gauge: &GaugeSection| gauge.bus.as_ref() == Some(&bus.name) && gauge.line.is_some();
    let section = config.patch.iter().find(|patch| patch.gauge.as_ref().is_some_and(on_it))?;
    line(config, section, &mut Faults::default())
}

/// The signal of a gauge on a CAN bus.
fn can(gauge: &GaugeSection, file: Option<&DbcFile>, faults: &mut Faults) -> Option<SignalSpec> {
    let of_gauge = |why: String| format!("gauge: {why}");
    let Some(name) = &gauge.signal else {
        faults.note("gauge.signal", "gauge.signal is missing: its place in the frame, as in \"0|32@1-\"");
        return None;
    };
    let inline = match gauge.id {
        Some(id) => Some(faults.take("gauge.signal", DbcFile::of_signal(id, name).map_err(of_gauge))?),
        None => None,
    };
    let place = match (&inline, file) {
        (Some(inline), _) => inline.one("gauge.signal"),
        (None, Some(file)) => file.one(name),
        (None, None) => Err("gauge.id is missing: the identifier of its frames, as in 0x3A1".to_owned()),
    };
    let place = faults.take("gauge.signal", place.map_err(of_gauge))?;
    let known = PressureUnit::NAMES;
    let named = gauge.unit.as_deref().unwrap_or(&place.signal.unit);
    let unknown = || match &gauge.unit {
        Some(name) => format!("gauge.unit = \"{name}\": unknown unit, expected one of {known}"),
        None if named.is_empty() => format!("gauge.unit is missing: expected one of {known}"),
        None => format!("gauge.unit is missing, and the DBC file has \"{named}\": expected one of {known}"),
    };
    let unit = faults.take("gauge.unit", PressureUnit::named(named).ok_or_else(unknown))?;
    faults.require("gauge.signal", place.frames.selectors.is_empty(), || {
        format!(": signal {}: it is multiplexed, expected a gauge in every frame of its message", place.name)
    });
    Some(place.pressure(unit))
}
