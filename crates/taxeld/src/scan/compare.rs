//! What is different on the bus from what the configuration says.

use std::collections::BTreeMap;

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::{BusIndex, ModuleKind};
use taxel_wire::CanId;

use super::findings::{BoardFound, Findings, ModuleFound};

/// Periods may be off by so much: boards' clocks, and medians of few scans.
const PERIOD_SHARE: f64 = 0.1;

/// A board as the configuration has it, over all patches.
#[derive(Debug, Default)]
struct Configured {
    period_ms: f64,
    modules: BTreeMap<u8, ModuleKind>,
}

/// The differences, a line each; none if all is as it should be.
#[must_use]
pub fn differences(findings: &Findings, plan: &Plan, bus: BusIndex) -> Vec<String> {
    let configured = configured(plan, bus);
    let mut lines = Vec::new();
    for (address, board) in &configured {
        match findings.boards.get(address) {
            Some(found) => board_differences(*address, board, found, &mut lines),
            None if findings.never_whole.contains_key(address) => {
                lines.push(format!("board {address} is configured and no whole scan of it was heard"));
            }
            None => lines.push(format!("board {address} is configured and was not heard")),
        }
    }
    for (address, found) in &findings.boards {
        if !configured.contains_key(address) {
            let modules = numbers(found.modules.keys());
            lines.push(format!("board {address} sends modules {modules} and is not configured"));
        }
    }
    for patch in plan.patches.iter().filter(|patch| patch.patch.is_on(bus)) {
        described_differences(patch, findings, &mut lines);
    }
    for patch in &plan.patches {
        if let Some(gauge) = patch.gauge.as_ref().filter(|gauge| gauge.bus == bus) {
            let id = gauge.signal.id.to_string();
            match findings.others.iter().find(|other| other.id == id) {
                None => lines.push(format!("{}: the gauge, identifier {id}, was not heard", patch.patch.name())),
                Some(other) if other.pressures.is_empty() => {
                    let name = patch.patch.name();
                    lines.push(format!("{name}: the gauge, identifier {id}, stood still or at no plausible pressure"));
                }
                Some(_) => {}
            }
        }
    }
    lines
}

/// Taxels that the configuration describes are no candidates for the gauge: they move with the pressure, too.
pub fn name_no_gauge_among_taxels(findings: &mut Findings, plan: &Plan, bus: BusIndex) {
    let of_bus = |patch: &&PatchPlan| patch.patch.is_on(bus);
    for patch in plan.patches.iter().filter(of_bus) {
        let gauge = patch.gauge.as_ref().map(|gauge| gauge.signal.id);
        for id in patch.devices.iter().flat_map(|device| device.ids()).filter(|id| gauge != Some(*id)) {
            let id = id.to_string();
            findings.others.iter_mut().filter(|other| other.id == id).for_each(|other| other.pressures.clear());
        }
    }
}

fn configured(plan: &Plan, bus: BusIndex) -> BTreeMap<u8, Configured> {
    let mut boards: BTreeMap<u8, Configured> = BTreeMap::new();
    for patch in plan.patches.iter().filter(|patch| patch.devices.is_empty()) {
        for board in patch.patch.boards().iter().filter(|board| board.bus == bus) {
            let entry = boards.entry(board.address.get()).or_default();
            entry.period_ms = patch.period.as_secs_f64() * 1e3;
            entry.modules.extend(board.modules.iter().map(|(module, kind)| (module.get(), *kind)));
        }
    }
    boards
}

/// What is different of a skin that is described by its signals: whether its frames come, and how often.
fn described_differences(plan: &PatchPlan, findings: &Findings, lines: &mut Vec<String>) {
    let mut frames: BTreeMap<CanId, u32> = BTreeMap::new();
    for device in &plan.devices {
        device.frames.iter().for_each(|spec| *frames.entry(spec.frames.id).or_default() += 1);
    }
    let name = plan.patch.name();
    for (id, per_scan) in frames {
        let expected = f64::from(per_scan) / plan.period.as_secs_f64();
        match findings.others.iter().find(|other| other.id == id.to_string()) {
            None => lines.push(format!("{name}: frames with identifier {id} were not heard")),
            Some(other) if (other.per_s / expected - 1.0).abs() > PERIOD_SHARE => lines.push(format!(
                "{name}: {:.1} frames with identifier {id} came a second, the configuration says {expected:.1}",
                other.per_s
            )),
            Some(_) => {}
        }
    }
}

fn board_differences(address: u8, board: &Configured, found: &BoardFound, lines: &mut Vec<String>) {
    let missing = numbers(board.modules.keys().filter(|module| !found.modules.contains_key(module)));
    if !missing.is_empty() {
        lines.push(format!("board {address}: modules {missing} are configured and were not heard"));
    }
    let more = numbers(found.modules.keys().filter(|module| !board.modules.contains_key(module)));
    if !more.is_empty() {
        lines.push(format!("board {address}: modules {more} send and are not configured"));
    }
    if let Some(ms) = found.period_ms.filter(|ms| (ms - board.period_ms).abs() > PERIOD_SHARE * board.period_ms) {
        let configured = board.period_ms;
        lines.push(format!("board {address} sends every {ms:.0} ms, the configuration says {configured:.0} ms"));
    }
    for (module, kind) in &board.modules {
        let of = |found: &&ModuleFound| found.pressed && !found.kinds.contains(&name(*kind));
        if let Some(found) = found.modules.get(module).filter(of) {
            let (is, can) = (name(*kind), found.kinds.join(" or "));
            lines.push(format!(
                "board {address} module {module}: configured as {is}, but its values are those of {can}"
            ));
        }
    }
}

const fn name(kind: ModuleKind) -> &'static str {
    match kind {
        ModuleKind::Triangle => "triangle",
        ModuleKind::Fingertip => "fingertip",
        ModuleKind::PalmPad11 => "palm-pad11",
        ModuleKind::PalmPad7 => "palm-pad7",
        ModuleKind::Cells(_) => "part of a foreign array",
    }
}

/// Numbers as a configuration writes them, in runs: `0-3, 7`.
#[must_use]
pub fn numbers<'a>(list: impl IntoIterator<Item = &'a u8>) -> String {
    let list: Vec<u8> = list.into_iter().copied().collect();
    let run = |run: &[u8]| match run {
        [first, .., last] => format!("{first}-{last}"),
        [only] => only.to_string(),
        [] => String::new(),
    };
    list.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(", ")
}
