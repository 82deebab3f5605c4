//! From `[[patch]]` to the plan of the patch.

use std::path::Path;
use std::time::Duration;

use taxel_dbc::DbcFile;
use taxel_engine::plan::{BoardSetup, DevicePlan, Outputs, PatchPlan, PushPlan, SessionLimits};
use taxel_model::FitOptions;
use taxel_skin::{BusIndex, Geometry, ModuleKind, NormalsVerdict, Patch, SquareMillimetre, area};

use super::array::{describe, grid, pushed};
use super::boards::{boards, bus_index};
use super::file::{BusSource, Config, beside};
use super::gauge::{comes_with_scans, gauge};
use super::limits::{gauge_uncertainty, live, session, tare};
use super::patch_section::{AreaWord, ArraySection, OutputWord, PatchSection};
use super::ports;
use super::problem::Said;
use taxel_files::read_any_text;
use taxel_rig::Faults;

/// MTB3 holds the period in a 16-bit timer that wraps beyond this.
const PERIOD_OF_BOARDS_MAX_MS: f64 = 209.0;
/// A skin that is slower is none that anybody is touched with.
const PERIOD_MAX_MS: f64 = 5000.0;
/// In less than this the converter of a skin board makes no new scan.
const CONVERSION_MS: u16 = 37;
/// Area of a taxel of an iCub triangle with its share of the gaps between modules 18 mm apart: a tenth of
/// (3 sqrt(3) / 4) (18 mm)^2. The soft layer carries load over the gaps, too.
const WITH_GAPS_MM2: f64 = 42.1;

/// The plan of a patch. Nothing if something is wrong with it, which is noted.
pub fn patch_plan(
    config: &Config,
    section: &PatchSection,
    path: &Path,
    (faults, said): (&mut Faults, &mut Said),
) -> Option<PatchPlan> {
    let name = &section.name;
    if name.is_empty() || name.len() > 64 || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
        faults.note("name", "a name is 1 to 64 letters, digits, `_` or `-`");
    }
    let period_max = if section.boards.is_empty() { PERIOD_MAX_MS } else { PERIOD_OF_BOARDS_MAX_MS };
    faults.range("period_ms", f64::from(section.period_ms), 1.0, period_max);
    let period = Duration::from_millis(u64::from(section.period_ms));
    let live = live(section, period, faults);
    let typed = section.gauge.as_ref().is_some_and(|gauge| gauge.typed);
    let session = SessionLimits { typed, ..session(&section.session, faults) };
    let stated = section.gauge.as_ref().map(|gauge| gauge_uncertainty(gauge, faults)).unwrap_or_default();
    let fit = FitOptions { gauge: stated, ..FitOptions::default() };
    let bus = bus_index(config, "bus", &section.bus, faults);
    let file = section.array.as_ref().and_then(|array| dbc_file(array, path, faults));
    let gauge = gauge(config, section, (file.as_ref(), bus), faults);
    let Some(bus) = bus else {
        skin(section, file.as_ref(), BusIndex(0), (path, faults)); // what else is wrong with it
        return None;
    };
    ports::check_patch(section, &config.bus[usize::from(bus.0)], faults);
    let push = push(config, section, bus, faults);
    let Skin { patch, devices, setups, geometry, areas } = skin(section, file.as_ref(), bus, (path, faults))?;
    said.remarks.extend(geometry.iter().flat_map(|g| &g.remarks).map(|r| format!("{name}: geometry: {r}")));
    let outputs = outputs(section, &patch, geometry.as_ref(), said);
    let padless = patch.modules().iter().all(|site| site.kind.thermal_slots().is_empty());
    tell(section, (devices.is_empty(), padless), said);
    Some(PatchPlan {
        areas,
        area_uncertainty: area_uncertainty(section, faults),
        bring_up: if section.listen_only || section.port.is_some() { Vec::new() } else { setups },
        devices,
        pushed: push,
        simulated: patch.boards().iter().any(|board| config.bus[usize::from(board.bus.0)].source == BusSource::Sim),
        period,
        geometry,
        gauge,
        outputs,
        live,
        tare: tare(section, period),
        follow_drift: section.follow_drift && !padless,
        session,
        fit,
        patch,
    })
}

fn dbc_file(array: &ArraySection, path: &Path, faults: &mut Faults) -> Option<DbcFile> {
    let file = beside(path, &array.dbc);
    // Comments and units of old files are not always UTF-8; names are letters, digits and `_` in any encoding.
    let text = faults.take("array.dbc", read_any_text(&file).map_err(|e| format!("array.dbc {e:#}")))?;
    faults.take("array.dbc", DbcFile::new(&text).map_err(|why| format!("array.dbc {}: {why}", file.display())))
}

/// What the patch leaves out, and what a user should know.
fn tell(section: &PatchSection, (of_boards, padless): (bool, bool), said: &mut Said) {
    let name = &section.name;
    let mut leave_out = |why: &str| said.left_out.push(format!("{name}: {why}"));
    if section.gauge.is_none() {
        leave_out("calibration: there is no gauge, so no pressure to fit to");
    }
    if !section.tare_at_start {
        leave_out("zero after start: tare_at_start is off, so a tare must be asked for");
    }
    if section.listen_only {
        leave_out("board bring-up: listen_only sends nothing");
    } else if section.port.is_some() {
        leave_out("board bring-up: nothing can be sent by a port, the robot's software configures its boards");
    }
    if !section.follow_drift {
        leave_out("following of thermal drift: follow_drift is off");
    } else if padless {
        leave_out("following of thermal drift: no module has a thermal pad");
    }
    if section.period_ms < CONVERSION_MS && of_boards {
        let period = section.period_ms;
        said.remarks
            .push(format!("{name}: the converter needs 36.9 ms a scan: at {period} ms old values are repeated"));
    }
}

/// Whether the scans of a patch are pushed, which its bus must say, too.
fn push(config: &Config, section: &PatchSection, bus: BusIndex, faults: &mut Faults) -> Option<PushPlan> {
    let is_push = config.bus[usize::from(bus.0)].source == BusSource::Push;
    let name = &section.bus;
    if section.push.is_some() && !is_push {
        faults.note("push", format!("push needs a bus with source = \"push\", and `{name}` has none"));
    } else if is_push && section.push.is_none() {
        faults.note("", format!("bus `{name}` has source = \"push\": expected push = {{ taxels = ... }}"));
    } else if is_push && config.patch.iter().filter(|patch| patch.bus == section.bus).count() > 1 {
        faults.note("bus", format!("bus `{name}` has source = \"push\": expected one patch on it"));
    }
    let pressure = comes_with_scans(section);
    section.push.map(|_| PushPlan { pressure })
}

/// The taxels of a patch, where they lie, and what each stands for.
struct Skin {
    patch: Patch,
    devices: Vec<DevicePlan>,
    setups: Vec<BoardSetup>,
    geometry: Option<Geometry>,
    areas: Vec<SquareMillimetre>,
}

fn skin(
    section: &PatchSection,
    file: Option<&DbcFile>,
    bus: BusIndex,
    (path, faults): (&Path, &mut Faults),
) -> Option<Skin> {
    let described = match (section.boards.is_empty(), &section.array, section.push) {
        (false, None, None) => None,
        (true, Some(array), None) => {
            let named = |why| format!("array.dbc {}: {why}", beside(path, &array.dbc).display());
            Some(faults.take("array", describe((section, array), file?, bus).map_err(named))?)
        }
        (true, None, Some(push)) => Some(faults.take("push", pushed(section, push, bus))?),
        _ => {
            faults.note("", "expected one of boards, [patch.array] and push: they say what the taxels are");
            return None;
        }
    };
    let (patch, devices, setups) = match described {
        Some((patch, devices)) => (patch, devices, Vec::new()),
        None => {
            let (boards, setups) = boards(section, bus, faults)?;
            (faults.take("boards", Patch::new(&section.name, boards))?, Vec::new(), setups)
        }
    };
    let is_described = !devices.is_empty();
    let (has_file, has_grid) = (section.geometry.is_some(), section.grid.is_some());
    faults.require("grid", is_described || !has_grid, || ": skin boards have a position file and no grid");
    faults.require("geometry", !is_described || !has_file, || ": an array has a grid and no position file");
    let of_grid = match section.grid.filter(|_| is_described) {
        Some(section) => Some(faults.take("grid", grid(section, patch.taxels().len()))?),
        None => None,
    };
    let geometry = match section.geometry.as_ref().filter(|_| !is_described) {
        Some(file) => faults.take("geometry", geometry(&beside(path, file), &patch)),
        None => of_grid.as_ref().map(|(geometry, _)| geometry.clone()),
    };
    let areas = areas(section, &patch, (is_described, of_grid.map(|(_, area)| area)), faults);
    Some(Skin { patch, devices, setups, geometry, areas })
}

fn geometry(file: &Path, patch: &Patch) -> Result<Geometry, String> {
    let text = read_any_text(file).map_err(|e| format!("geometry {e:#}"))?;
    Geometry::parse(&text, patch).map_err(|e| format!("geometry {}: {e}", file.display()))
}

/// The area of each taxel.
fn areas(
    section: &PatchSection,
    patch: &Patch,
    (is_described, of_grid): (bool, Option<SquareMillimetre>),
    faults: &mut Faults,
) -> Vec<SquareMillimetre> {
    let usual = match section.area {
        AreaWord::Template => WITH_GAPS_MM2,
        AreaWord::Equal => SquareMillimetre::ICUB_TAXEL.0,
    };
    faults.require(
        "",
        !is_described || of_grid.is_some() || section.area_mm2.is_some(),
        || "area_mm2 or grid is missing: without either the force of a pressure is not known",
    );
    let mean = section.area_mm2.or(of_grid.map(|area| area.0)).unwrap_or(usual);
    faults.range("area_mm2", mean, 0.01, 1e5);
    match section.area {
        AreaWord::Template => area::template(patch, SquareMillimetre(mean)),
        AreaWord::Equal => vec![SquareMillimetre(mean); patch.taxels().len()],
    }
}

/// Without a known load nobody knows the spacing of the modules better than to within 0.8 mm of 18 mm: bounds of a tenth of the
/// area, so a standard uncertainty of a twentieth. The triangles alone leave the gaps out, a quarter of the area.
fn area_uncertainty(section: &PatchSection, faults: &mut Faults) -> f64 {
    let gaps_left_out = section.area != AreaWord::Template && section.area_mm2.is_none();
    let stated = section.area_uncertainty.unwrap_or(if gaps_left_out { 0.2 } else { 0.05 });
    faults.range("area_uncertainty", stated, 0.0, 1.0)
}

fn outputs(section: &PatchSection, patch: &Patch, geometry: Option<&Geometry>, said: &mut Said) -> Outputs {
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
            said.left_out.push(format!("{}: {what}: {why}", section.name));
        }
        computed
    };
    Outputs {
        resultant: decide(OutputWord::Resultant, "resultant", directed),
        moment: decide(OutputWord::Moment, "moment and centre of pressure", directed),
        contacts: decide(OutputWord::Contacts, "contacts", geometry.is_some()),
        fill: decide(OutputWord::Fill, "fill of excluded taxels", geometry.is_some()),
        // No output but the total itself; only of triangles it is known where their pads lie under which layer.
        place: geometry.is_some() && patch.modules().iter().all(|site| site.kind == ModuleKind::Triangle),
    }
}
