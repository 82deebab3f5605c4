//! From the file to the plan: values checked, names looked up, and what the scene leaves out.

use std::path::Path;
use std::time::Duration;
use taxel_engine::conflict::conflicts;
use taxel_engine::plan::{DevicePlan, DriftPlan, Gauge, Outputs, PatchPlan, Plan, PushPlan, TarePlan};
use taxel_rpc::Rules;
use taxel_skin::{BusIndex, Geometry, NormalsVerdict, Patch, SquareMillimetre};
use taxel_wire::CanId;
use taxel_wire::signal::{ByteOrder, PressureMeaning, SignalSpec};

use super::area_words::AreaFactorWord;
use super::boards::{board, key_of, placed, setup};
use super::bus_load::crowded;
use super::fault::{Fault, within};
use super::file::Config;
use super::listen::{Doors, doors};
use super::load::ConfigError;
use super::load::beside;
use super::log_filter::log_filter;
use super::number_words::OrderOfBytes;
use super::parts::{BoardSection, BusSource, GaugeSection, LogSection, OutputWord, PatchSection};
use super::patch_limits::{drift, fit_options, gauge_uncertainty, live, session};
use super::signals::{Described, describe, pushed};
use crate::files::read_any_text;

/// MTB3 holds the period in a 16-bit timer that wraps beyond this.
const PERIOD_OF_BOARDS_MAX_MS: u8 = 209;
/// A skin that is slower is none that anybody is touched with.
const PERIOD_MAX_MS: u16 = 5000;

/// What an installation needs, resolved once.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What the engine does.
    pub plan: Plan,
    /// Where the service listens, and who may do what.
    pub doors: Doors,
    /// What is left out and why, a line each.
    pub left_out: Vec<String>,
    /// What a user should know, a line each.
    pub remarks: Vec<String>,
}

/// Resolves a configuration; `path` is where it came from, for files relative to it and for messages.
///
/// # Errors
/// [`ConfigError::Unusable`] with the key, its value and what was expected.
pub fn resolve(config: &Config, path: &Path) -> Result<Scene, ConfigError> {
    let unusable = |problem: &str| ConfigError::Unusable { path: path.into(), problem: problem.to_owned() };
    let scene = scene_of(config, path).map_err(|fault| unusable(fault.words()))?;
    let clashes = clashes(config, &scene.plan);
    let words: Vec<&str> = clashes.iter().map(Fault::words).collect();
    if words.is_empty() { Ok(scene) } else { Err(unusable(&words.join("; "))) }
}

/// The same, whether or not the patches contradict each other.
///
/// # Errors
/// The key, its value and what was expected.
pub fn scene_of(config: &Config, path: &Path) -> Result<Scene, Fault> {
    let plan = Plan { buses: config.bus.len(), patches: vec![] };
    let nowhere = Doors { doors: vec![], rules: Rules::open(), tokens: None, ruled: false };
    let mut scene = Scene { plan, doors: nowhere, left_out: vec![], remarks: vec![] };
    check_buses(config)?;
    config.service.problem().map_or(Ok(()), Err)?;
    log(&config.log)?;
    for (number, section) in config.patch.iter().enumerate() {
        let named = |fault: Fault| fault.within(&format!("patch[{number}]"), &format!("patch `{}`", section.name));
        let section = &super::dbc::expand(section, path).map_err(|why| named(why.into()))?;
        let plan = resolve_patch(config, section, path, &mut scene).map_err(named)?;
        if scene.plan.patches.iter().any(|p| p.patch.name() == plan.patch.name()) {
            let words = format!("patch `{}` is there twice", section.name);
            return Err(Fault::of(format!("patch[{number}].name"), words));
        }
        scene.plan.patches.push(plan);
    }
    if scene.plan.patches.is_empty() {
        return Err("there is no [[patch]]: at least one is needed".to_owned().into());
    }
    super::page_section::problem(config.page.as_ref(), config.metrics.as_ref()).map_or(Ok(()), Err)?;
    shared_memory(config)?;
    let unrecordable = config.record.as_ref().and_then(super::record_section::problem);
    unrecordable.map_or(Ok(()), |(key, words)| Err(Fault::of(key, words)))?;
    scene.doors = doors(config, path)?;
    scene.remarks.extend(crowded(config, &scene.plan));
    Ok(scene)
}

/// What is wrong with the pages in shared memory.
fn shared_memory(config: &Config) -> Result<(), Fault> {
    let memory = config.shared_memory.as_ref();
    let problem = memory.and_then(|section| super::shared_memory_section::problem(section, config.access.as_ref()));
    problem.map_or(Ok(()), |problem| Err(Fault::of("shared_memory", problem)))
}

/// Where the patches of a plan contradict each other.
pub fn clashes(config: &Config, plan: &Plan) -> Vec<Fault> {
    let found = conflicts(plan);
    found.iter().map(|conflict| Fault::of(key_of(config, conflict), placed(config, conflict))).collect()
}

fn log(section: &LogSection) -> Result<(), Fault> {
    let Some(wanted) = &section.filter else { return Ok(()) };
    let wrong = |error: String| Fault::of("log.filter", format!("log.filter = \"{wanted}\": {error}"));
    log_filter(wanted).map(|_| ()).map_err(wrong)
}

fn check_buses(config: &Config) -> Result<(), Fault> {
    if config.bus.len() > usize::from(u8::MAX) {
        return Err(format!("{} buses, at most 255 are possible", config.bus.len()).into());
    }
    for (i, bus) in config.bus.iter().enumerate() {
        if config.bus[..i].iter().any(|b| b.name == bus.name) {
            return Err(Fault::of(format!("bus[{i}].name"), format!("bus `{}` is there twice", bus.name)));
        }
        if bus.source == BusSource::SocketCan && bus.interface.is_none() {
            let words = format!("bus `{}`: source socketcan needs an interface, for example \"can0\"", bus.name);
            return Err(Fault::of(format!("bus[{i}]"), words));
        }
    }
    Ok(())
}

fn bus_index(config: &Config, key: &str, name: &str) -> Result<BusIndex, Fault> {
    let position = config.bus.iter().position(|bus| bus.name == name);
    let names = || config.bus.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
    let position =
        position.ok_or_else(|| Fault::of(key, format!("bus `{name}` is not among the buses: {}", names())))?;
    Ok(BusIndex(position as u8))
}

/// 15 is the address of all boards of a bus: what is sent to it configures each of them.
fn refuse_commands_to_everyone(section: &PatchSection) -> Result<(), Fault> {
    match section.board.iter().position(|board| board.address == 15) {
        Some(board) if !section.listen_only => {
            let words = "a command to address 15 goes to all boards of the bus: set listen_only = true";
            Err(Fault::of(format!("board[{board}].address"), words))
        }
        _ => Ok(()),
    }
}

fn resolve_patch(config: &Config, section: &PatchSection, path: &Path, scene: &mut Scene) -> Result<PatchPlan, Fault> {
    let bus = bus_index(config, "bus", &section.bus)?;
    let name = &section.name;
    if name.is_empty() || name.len() > 64 || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        return Err(Fault::of("name", "a name is 1 to 64 letters, digits, `_` or `-`"));
    }
    let period_max = if section.board.is_empty() { PERIOD_MAX_MS } else { u16::from(PERIOD_OF_BOARDS_MAX_MS) };
    within("period_ms", f64::from(section.period_ms), 1.0, f64::from(period_max))?;
    within("area_mm2", super::area::mean_mm2(section), 0.01, 1e5)?;
    let area_uncertainty = super::area::uncertainty(section);
    within("area_uncertainty", area_uncertainty, 0.0, 1.0)?;
    within("tare.seconds", section.tare.seconds, 0.1, 60.0)?;
    let period = Duration::from_millis(u64::from(section.period_ms));
    let (drift, live) = (drift(&section.drift)?, live(&section.live, period)?);
    let session = session(&section.session, section.fit.plays)?;
    let fit = fit_options(&section.fit, gauge_uncertainty(section.gauge.as_ref(), section.push.as_ref())?)?;
    let gauge = section.gauge.as_ref().map(|g| gauge(config, g, bus)).transpose()?;
    let Skin { patch, devices, geometry, areas } = skin(section, bus, path, scene)?;
    let outputs = outputs(section, geometry.as_ref(), scene);
    let push = push(config, section, bus, gauge.as_ref())?;
    if gauge.is_none() && !push.is_some_and(|push| push.pressure) {
        scene.left_out.push(format!("{name}: calibration: there is no [patch.gauge], so no pressure to fit to"));
    }
    if !section.tare.at_start {
        scene.left_out.push(format!("{name}: zero after start: tare.at_start is off, so a tare must be asked for"));
    }
    if section.period_ms < 37 && devices.is_empty() {
        let period = section.period_ms;
        scene
            .remarks
            .push(format!("{name}: the converter needs 36.9 ms a scan: at {period} ms old values are repeated"));
    }
    if section.listen_only {
        scene.left_out.push(format!("{name}: board bring-up: listen_only sends nothing"));
    }
    refuse_commands_to_everyone(section)?;
    let setups = of_boards(section, |b| setup(b, section.period_ms as u8))?;
    if section.tare.first_scans.is_some() {
        scene.remarks.push(format!("{name}: tare.first_scans has no effect any more: every zero is watched in full"));
    }
    let padless = patch.modules().iter().all(|site| site.kind.thermal_slots().is_empty());
    if !drift.follow || padless {
        let why = if drift.follow { "no module has a thermal pad" } else { "drift.follow is off" };
        scene.left_out.push(format!("{name}: following of thermal drift: {why}"));
    }
    Ok(PatchPlan {
        areas,
        area_uncertainty,
        area_from_loads: section.area_factor == AreaFactorWord::FromLoads,
        bring_up: if section.listen_only { Vec::new() } else { setups },
        devices,
        pushed: push,
        simulated: patch.boards().iter().any(|board| config.bus[usize::from(board.bus.0)].source == BusSource::Sim),
        period,
        geometry,
        gauge,
        outputs,
        live,
        faults: Default::default(),
        tare: tare(section, period),
        drift: DriftPlan { follow: drift.follow && !padless, ..drift },
        session,
        fit,
        patch,
    })
}

/// A slow array is watched until it has sent what a zero needs.
fn tare(section: &PatchSection, period: Duration) -> TarePlan {
    let rest = TarePlan::default().rest;
    let enough = period.saturating_mul(rest.scans_min as u32);
    let duration = Duration::from_secs_f64(section.tare.seconds).max(enough);
    TarePlan { duration, at_start: section.tare.at_start, rest }
}

/// Whether the scans of a patch are pushed, which its bus must say, too.
fn push(
    config: &Config,
    section: &PatchSection,
    bus: BusIndex,
    gauge: Option<&Gauge>,
) -> Result<Option<PushPlan>, String> {
    let is_push = |bus: BusIndex| config.bus.get(usize::from(bus.0)).is_some_and(|bus| bus.source == BusSource::Push);
    if gauge.is_some_and(|gauge| is_push(gauge.bus)) {
        return Err("gauge.bus: a gauge sends over a CAN bus; or set push.pressure = true in place of it".to_owned());
    }
    let Some(push) = section.push.filter(|_| is_push(bus)) else {
        return match (section.push, is_push(bus)) {
            (Some(_), _) => {
                Err(format!("[patch.push] needs a bus with source = \"push\", and `{}` has none", section.bus))
            }
            (None, true) => Err(format!("bus `{}` has source = \"push\": expected [patch.push]", section.bus)),
            (None, false) => Ok(None),
        };
    };
    if push.pressure && gauge.is_some() {
        return Err("push.pressure and [patch.gauge] are both there: expected one of them".to_owned());
    }
    if config.patch.iter().filter(|patch| patch.bus == section.bus).count() > 1 {
        return Err(format!("bus `{}` has source = \"push\": expected one patch on it", section.bus));
    }
    Ok(Some(PushPlan { pressure: push.pressure }))
}

/// The taxels of a patch, where they lie, and what each stands for.
struct Skin {
    patch: Patch,
    devices: Vec<DevicePlan>,
    geometry: Option<Geometry>,
    areas: Vec<SquareMillimetre>,
}

fn skin(section: &PatchSection, bus: BusIndex, path: &Path, scene: &mut Scene) -> Result<Skin, Fault> {
    let name = &section.name;
    let described = described(section, bus)?;
    if described.as_ref().is_some_and(|described| described.area.is_none()) && section.area_mm2.is_none() {
        let why = "area_mm2: expected, or a grid in [patch.array]: without either the force of a pressure is not known";
        return Err(why.to_owned().into());
    }
    let patch = match &described {
        Some(described) => described.patch.clone(),
        None => {
            let boards = of_boards(section, |b| board(b, bus))?;
            Patch::new(name, boards).map_err(|e| Fault::from(e.to_string()))?
        }
    };
    let geometry = match &described {
        Some(described) => described.geometry.clone(),
        None => section.geometry.as_ref().map(|file| geometry(file, path, &patch)).transpose().map_err(of_geometry)?,
    };
    if let Some(g) = &geometry {
        scene.remarks.extend(g.remarks.iter().map(|r| format!("{name}: geometry: {r}")));
    }
    let (mut areas, remark) = super::area::areas(section, &patch, geometry.as_ref());
    if let Some(area) = described.as_ref().and_then(|d| d.area).filter(|_| section.area_mm2.is_none()) {
        areas.fill(area);
    }
    scene.remarks.extend(remark);
    let devices = described.map(|described| described.devices).unwrap_or_default();
    Ok(Skin { patch, devices, geometry, areas })
}

/// What each board of a patch gives, or which one is wrong.
fn of_boards<T>(section: &PatchSection, give: impl Fn(&BoardSection) -> Result<T, String>) -> Result<Vec<T>, Fault> {
    let boards = section.board.iter().enumerate();
    boards.map(|(n, board)| give(board).map_err(|why| Fault::of(format!("board[{n}]"), why))).collect()
}

fn of_geometry(why: String) -> Fault {
    Fault::of("geometry", why)
}

/// The taxels that signals describe; `None` for skin boards.
fn described(section: &PatchSection, bus: BusIndex) -> Result<Option<Described>, String> {
    if let Some(push) = section.push {
        if !section.board.is_empty() || !section.signals.is_empty() || section.geometry.is_some() {
            return Err(
                "[patch.push] and boards, signals or a position file in one patch: expected it alone".to_owned()
            );
        }
        return pushed(section, push, bus).map(Some);
    }
    match (section.board.is_empty(), section.signals.is_empty()) {
        (false, true) if section.array.is_none() => Ok(None),
        (true, false) if section.geometry.is_none() => describe(section, bus).map(Some),
        (true, false) => {
            Err("geometry: taxels of signals have the grid of [patch.array] and no position file".to_owned())
        }
        (true, true) => {
            Err("there is no taxel: expected [[patch.board]], [[patch.signals]] or [patch.push]".to_owned())
        }
        _ => Err("[[patch.board]] and signals in one patch: expected either".to_owned()),
    }
}

fn geometry(file: &Path, config: &Path, patch: &Patch) -> Result<Geometry, String> {
    let file = beside(config, file);
    let text = read_any_text(&file).map_err(|e| format!("geometry {}: {e}", file.display()))?;
    Geometry::parse(&text, patch).map_err(|e| format!("geometry {}: {e}", file.display()))
}

fn outputs(section: &PatchSection, geometry: Option<&Geometry>, scene: &mut Scene) -> Outputs {
    let asked = |word| section.outputs.contains(&word);
    let directed = geometry.is_some_and(|g| g.normals == NormalsVerdict::Usable);
    let lacks = if geometry.is_some() { "the geometry has no usable normals" } else { "there is no geometry" };
    let mut decide = |word, what: &str, possible: bool| {
        let computed = asked(word) && possible;
        let why = match (asked(word), possible) {
            (true, _) => lacks.to_owned(),
            (false, true) => "not asked for in outputs".to_owned(),
            (false, false) => format!("not asked for in outputs, and {lacks}"),
        };
        if !computed {
            scene.left_out.push(format!("{}: {what}: {why}", section.name));
        }
        computed
    };
    Outputs {
        resultant: decide(OutputWord::Resultant, "resultant", directed),
        moment: decide(OutputWord::Moment, "moment and centre of pressure", directed),
        contacts: decide(OutputWord::Contacts, "contacts", geometry.is_some()),
        fill: decide(OutputWord::Fill, "fill of excluded taxels", geometry.is_some()),
    }
}

fn gauge(config: &Config, section: &GaugeSection, patch_bus: BusIndex) -> Result<Gauge, Fault> {
    let bus = section.bus.as_ref().map_or(Ok(patch_bus), |name| bus_index(config, "gauge.bus", name))?;
    let id = if section.extended {
        CanId::Extended(section.id)
    } else {
        CanId::Standard(
            u16::try_from(section.id)
                .map_err(|_| Fault::of("gauge.id", format!("gauge.id {:#x} has more than 11 bits", section.id)))?,
        )
    };
    let signal = SignalSpec {
        id,
        start_bit: section.start_bit,
        length_bits: section.length_bits,
        byte_order: match section.byte_order {
            OrderOfBytes::Little => ByteOrder::Little,
            OrderOfBytes::Big => ByteOrder::Big,
        },
        signed: section.signed,
        scale: section.scale,
        offset: section.offset,
        unit: section.unit.0,
        meaning: section
            .ambient_kpa
            .map_or(PressureMeaning::Differential, |ambient_kpa| PressureMeaning::AbsoluteBag { ambient_kpa }),
    };
    signal.validate().map_err(|e| Fault::of("gauge", format!("gauge: {e}")))?;
    Ok(Gauge { bus, signal })
}

#[cfg(all(test, feature = "sim"))]
mod tests {
    use super::super::parse;
    use super::*;

    #[test]
    fn a_force_says_whether_a_simulator_makes_it() {
        let path = Path::new("t.toml");
        let demo = include_str!("../demo_config.toml");
        let on_a_bus = demo.replace("source = \"sim\"", "source = \"socketcan\"\ninterface = \"can0\"");
        assert_ne!(demo, on_a_bus);
        for (text, simulated) in [(demo, true), (&on_a_bus, false)] {
            let scene = resolve(&parse(path, text).unwrap(), path).unwrap();
            assert_eq!(scene.plan.patches[0].simulated, simulated, "{text}");
        }
    }
}
