//! `taxeld check`: what a configuration resolves to, and what it leaves out.

use std::path::Path;

use anyhow::Context;
use taxel_engine::engine::routes::Routes;
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_rig::Speech;
use taxel_rpc::{Grant, Role, Subject};
use taxel_skin::{BusIndex, SquareMillimetre, counted, printable, written_modules};

use crate::config::{self, BusSource, Config, Doors, RecordSection, SharedMemorySection, UNRULED};
use crate::rig::ASK_EVERY;

/// Bits of a classic frame with eight bytes, unstuffed and with the gap that follows, at 1 Mbit/s in seconds.
const FRAME_S: f64 = 111e-6;

/// Prints a line. What the configuration has in it a terminal must not act upon: that is written out.
macro_rules! tell {
    ($($text:tt)*) => { say!("{}", printable(&format!($($text)*))) };
}

/// Checks a configuration: prints what it resolves to, or everything that is wrong with it.
///
/// # Errors
/// Everything that is wrong with it.
pub fn check(path: &Path) -> anyhow::Result<()> {
    let (config, scene) = config::examine(path)?;
    let store = std::path::absolute(&config.store.path).unwrap_or_else(|_| config.store.path.clone());
    tell!("store: {}, one SQLite file", store.display());
    tell!("service: gRPC");
    scene.doors.doors.iter().for_each(|door| tell!("  on {door}"));
    access(&scene.doors).iter().for_each(|line| tell!("  {line}"));
    if let Some(page) = &config.page {
        tell!("page: http://{}/ (loopback, unencrypted), the service as JSON, and /metrics", page.listen);
    }
    if let Some(SharedMemorySection { path, group }) = &config.shared_memory {
        let group = group.as_ref().map_or(String::new(), |group| format!(", group {group}"));
        tell!("shared memory: {} (mode 640{group})", path.join("PATCH").display());
    }
    if let Some(RecordSection { path, budget_mb, taxels }) = &config.record {
        let taxels = if *taxels { ", taxels" } else { "" };
        let path = path.display();
        tell!("recording: frames, force, events{taxels} in {path}, {budget_mb} MB of MCAP files at most");
    }
    let routes = Routes::new(&scene.plan);
    for position in 0..config.bus.len() {
        tell!("{}", bus(&config, &scene.plan, &routes, BusIndex(position as u8)));
    }
    scene.plan.patches.iter().for_each(|plan| patch(&config, plan));
    tell!("left out:");
    left_out_buses(&config, &routes).iter().chain(&scene.said.left_out).for_each(|line| tell!("  {line}"));
    if !scene.said.remarks.is_empty() {
        tell!("remarks:");
        scene.said.remarks.iter().for_each(|line| tell!("  {line}"));
    }
    Ok(())
}

/// Checks the profile of a drive, without the drive: prints what it says, or everything that is wrong with it.
///
/// # Errors
/// Everything that is wrong with it.
pub fn device(file: &str) -> anyhow::Result<()> {
    let (profile, _) = config::examine_profile(file, None)?;
    tell!("drive {} on {}", profile.name(), profile.at());
    profile.lines().iter().for_each(|line| tell!("  {line}"));
    Ok(())
}

/// Looks at a store that no daemon has open, and changes nothing.
///
/// # Errors
/// If it cannot be opened, or something of it is damaged.
pub fn store(path: &Path) -> anyhow::Result<()> {
    let found = taxel_store::check(path).with_context(|| path.display().to_string())?;
    let mb = found.bytes as f64 / 1e6;
    say!("model sets: {}, sessions: {}, samples: {}, {mb:.1} MB", found.model_sets, found.sessions, found.samples);
    found.damage.iter().for_each(|damage| say!("{damage}"));
    anyhow::ensure!(found.damage.is_empty(), "findings: {}", found.damage.len());
    Ok(())
}

/// Who may do what, a line each.
fn access(doors: &Doors) -> Vec<String> {
    let Some(rules) = &doors.rules else { return vec![UNRULED.to_owned()] };
    let word = |role: Option<Role>| role.map_or("none", Role::name);
    let ways = [
        ("over loopback TCP without a token", rules.loopback),
        ("on the Unix socket", rules.unix),
        ("with a certificate that no list of [access] names", rules.certificate),
        ("from elsewhere without TLS", rules.insecure),
    ];
    let mut lines: Vec<String> = ways.iter().map(|(way, role)| format!("access: {} {way}", word(*role))).collect();
    lines.extend(rules.grants.iter().map(|Grant { subject, role }| match subject {
        Subject::User(name) => format!("access: {role} for user {name}"),
        Subject::Group(name) => format!("access: {role} for group {name}"),
        Subject::Certificate(name) => format!("access: {role} for certificate {name}"),
    }));
    lines.extend(doors.tokens.iter().map(|path| format!("access: tokens of {}", path.display())));
    lines.extend(doors.unreached_grants());
    lines
}

fn bus(config: &Config, plan: &Plan, routes: &Routes, bus: BusIndex) -> String {
    let section = &config.bus[bus.0 as usize];
    let source = match section.source {
        BusSource::Push => {
            let what = if routes.wanted(bus).is_empty() { "scans" } else { "pressure" };
            return format!("bus {}: none; a program pushes the {what} over the service (PushScans)", section.name);
        }
        BusSource::Line => {
            let Some(line) = config::line_of(config, section) else { return String::new() };
            let how = match &line.speech {
                Speech::Text { poll, .. } if poll.is_empty() => "prints by itself".to_owned(),
                Speech::Text { poll, .. } => format!("is asked {poll:?} every {} ms", ASK_EVERY.as_millis()),
                Speech::Modbus(request, _) => {
                    let (slave, address) = request.of();
                    format!("register {address} of slave {slave} is read every {} ms", ASK_EVERY.as_millis())
                }
            };
            return format!("gauge on {}: {how}", line.at);
        }
        BusSource::Yarp => {
            let port = config::port_of(config, plan, bus).map_or_else(String::new, |(port, _)| port);
            format!("port {port} of {}", section.server.as_deref().unwrap_or("YARP's name server"))
        }
        BusSource::Sim => "the simulated forearm".to_owned(),
        BusSource::SocketCan => format!("interface {}", section.interface.as_deref().unwrap_or_default()),
    };
    let speaks = |p: &PatchPlan| p.configures() && p.patch.is_on(bus);
    let sends = if plan.patches.iter().any(speaks) { "sends the boards' bring-up" } else { "nothing is sent" };
    format!("bus {}: {source}; {} identifiers are read; {sends}", section.name, routes.wanted(bus).len())
}

fn patch(config: &Config, plan: &PatchPlan) {
    let patch = &plan.patch;
    let modules = counted(patch.modules().len(), "module", "modules");
    tell!("patch {}: {} taxels on {modules}", patch.name(), patch.taxels().len());
    for board in patch.boards() {
        let bus = config.bus.get(board.bus.0 as usize).map_or("", |section| &section.name);
        let kind = if plan.devices.is_empty() { "board" } else { "device" };
        tell!("  {kind} {} of bus {bus}: modules {}", board.address, written_modules(&board.modules));
    }
    if !plan.devices.is_empty() {
        let (top, per_unit) = (patch.counts().top(), patch.counts().per_unit());
        tell!("  counts: 0 to {top}, {per_unit} of them to a unit of all keys and figures in counts");
    }
    let (scans_per_s, ms) = (1.0 / plan.period.as_secs_f64(), plan.period.as_millis());
    if plan.pushed.is_some() {
        tell!("  takes: {scans_per_s:.0} pushed scans/s at {ms} ms");
    } else {
        reads(plan);
    }
    let outputs = plan.outputs;
    let computed = [
        (", resultant", outputs.resultant),
        (", moment and centre of pressure", outputs.moment),
        (", contacts", outputs.contacts),
        (", fill of excluded taxels", outputs.fill),
    ];
    let computed: String = computed.iter().filter(|(_, there)| *there).map(|(words, _)| *words).collect();
    tell!("  computes: total normal force{computed}");
    tell!("  {}", areas(&plan.areas));
}

/// What a patch reads from its bus.
fn reads(plan: &PatchPlan) {
    let frames = match plan.devices.iter().map(|device| device.frames.len()).sum::<usize>() {
        0 => 2 * plan.patch.modules().len(),
        described => described,
    };
    let (frames_per_s, ms) = (frames as f64 / plan.period.as_secs_f64(), plan.period.as_millis());
    tell!("  reads: {frames_per_s:.0} frames/s at {ms} ms: {:.1} % of a 1 Mbit/s bus", 100.0 * frames_per_s * FRAME_S);
}

/// Sum and range of the areas of the taxels.
fn areas(areas: &[SquareMillimetre]) -> String {
    let total: f64 = areas.iter().map(|area| area.0).sum();
    let (least, most) = areas.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), area| (a.min(area.0), b.max(area.0)));
    let each = if least < most { format!("{least:.1} to {most:.1}") } else { format!("{most:.1}") };
    format!("area: {each} mm2 a taxel, {:.1} cm2 in all", total * 1e-2)
}

fn left_out_buses(config: &Config, routes: &Routes) -> Vec<String> {
    let unused = config.bus.iter().enumerate().filter(|(bus, _)| routes.wanted(BusIndex(*bus as u8)).is_empty());
    unused
        .filter(|(_, section)| section.source != BusSource::Push)
        .map(|(_, section)| format!("bus {}: no board and no gauge is on it: nothing is read", section.name))
        .collect()
}
