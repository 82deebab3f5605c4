//! `taxeld check`: what a configuration resolves to, and what it leaves out.

use taxel_engine::engine::routes::{Route, Routes};
use taxel_engine::plan::{PatchPlan, Plan};
use taxel_skin::{Board, BusIndex, SquareMillimetre};

use crate::config::{BusSource, Config, Scene};

/// One socket takes so many kernel filters (`CAN_RAW_FILTER_MAX`); beyond, `taxel-can` merges them.
const FILTERS_MAX: usize = 512;

/// Bits of a classic frame with eight bytes, unstuffed and with the gap that follows, at 1 Mbit/s in seconds.
const FRAME_S: f64 = 111e-6;

/// Prints the resolved scene.
pub fn print(config: &Config, scene: &Scene) {
    let service = &config.service;
    say!("store: {}, one SQLite file", config.store.path.display());
    say!(
        "service: gRPC on {} (loopback, unencrypted), at most {} streams on {} connections",
        service.listen,
        service.subscribers_max,
        service.connections_max
    );
    let routes = Routes::new(&scene.plan);
    for position in 0..config.bus.len() {
        say!("{}", bus(config, &scene.plan, &routes, BusIndex(position as u8)));
    }
    scene.plan.patches.iter().for_each(|plan| patch(config, plan));
    say!("threads:");
    threads(config, &scene.plan).iter().for_each(|line| say!("  {line}"));
    let built = left_out_of_the_build();
    say!("left out:");
    left_out_buses(config, &routes).iter().chain(&scene.left_out).chain(&built).for_each(|line| say!("  {line}"));
    if !scene.remarks.is_empty() {
        say!("remarks:");
        scene.remarks.iter().for_each(|line| say!("  {line}"));
    }
}

fn bus(config: &Config, plan: &Plan, routes: &Routes, bus: BusIndex) -> String {
    let section = &config.bus[bus.0 as usize];
    let wanted = routes.wanted(bus);
    let modules = wanted.iter().filter(|id| matches!(routes.of(bus, **id), Route::Module { .. })).count();
    let gauges = wanted.iter().filter(|id| routes.of(bus, **id) == Route::Gauge).count();
    let boards = wanted.len() - modules - gauges;
    let kinds = format!("{modules} of modules, {boards} of boards, {gauges} of gauges");
    let source = match (section.source, wanted.len()) {
        (BusSource::Sim, ids) => format!("the simulated forearm; {ids} identifiers are read ({kinds})"),
        (BusSource::SocketCan, ids) => {
            let interface = section.interface.as_deref().unwrap_or_default();
            let filters = if ids <= FILTERS_MAX {
                format!("{ids} kernel filters, one an identifier")
            } else {
                format!("{ids} identifiers, merged into fewer kernel filters")
            };
            format!("interface {interface}; {filters} ({kinds})")
        }
    };
    let speaks = |p: &PatchPlan| !p.bring_up.is_empty() && p.patch.boards().iter().any(|board| board.bus == bus);
    let sends = if plan.patches.iter().any(speaks) { "sends the boards' bring-up" } else { "nothing is sent" };
    format!("bus {}: {source}; {sends}", section.name)
}

fn patch(config: &Config, plan: &PatchPlan) {
    let patch = &plan.patch;
    say!("patch {}: {} taxels on {} modules", patch.name(), patch.taxels().len(), patch.modules().len());
    for board in patch.boards() {
        let bus = config.bus.get(board.bus.0 as usize).map_or("", |section| &section.name);
        say!("  board {} of bus {bus}: modules {}", board.address, modules(board));
    }
    let frames_per_s = 2.0 * patch.modules().len() as f64 / plan.period.as_secs_f64();
    say!(
        "  reads: {frames_per_s:.0} frames/s at {} ms: {:.1} % of a 1 Mbit/s bus",
        plan.period.as_millis(),
        frames_per_s * FRAME_S * 100.0
    );
    let outputs = plan.outputs;
    let computed = [
        ("total normal force", true),
        ("resultant", outputs.resultant),
        ("moment and centre of pressure", outputs.moment),
        ("contacts", outputs.contacts),
        ("fill of excluded taxels", outputs.fill),
    ];
    say!("  computes: {}", listed(&computed));
    say!("  encodes: one force message a subscriber; per-taxel messages only for subscribers to taxels");
    let parts = [
        ("geometry", plan.geometry.is_some()),
        ("calibration with the gauge", plan.gauge.is_some()),
        ("board bring-up", !plan.bring_up.is_empty()),
        ("zero after start", plan.tare.at_start),
        ("areas set right by known loads", plan.area_from_loads),
        ("following of thermal drift", plan.drift.follow),
    ];
    say!("  optional parts: {}", listed(&parts));
    say!("  {}", areas(&plan.areas));
}

/// Sum and range of the areas of the taxels.
fn areas(areas: &[SquareMillimetre]) -> String {
    let total: f64 = areas.iter().map(|area| area.0).sum();
    let (least, most) = areas.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), area| (a.min(area.0), b.max(area.0)));
    let each = if least < most { format!("{least:.1} to {most:.1}") } else { format!("{most:.1}") };
    format!("area: {each} mm2 a taxel, {:.1} cm2 in all", total * 1e-2)
}

/// The words whose part is there.
fn listed(parts: &[(&str, bool)]) -> String {
    let words: Vec<&str> = parts.iter().filter(|(_, there)| *there).map(|(word, _)| *word).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

/// A board's modules as a configuration writes them: `0-3, 7`.
fn modules(board: &Board) -> String {
    let numbers: Vec<u8> = board.modules.iter().map(|(module, _)| module.get()).collect();
    let run = |run: &[u8]| match run {
        [first, .., last] => format!("{first}-{last}"),
        [only] => only.to_string(),
        [] => String::new(),
    };
    numbers.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(", ")
}

/// The threads of `taxeld run` and what each is for.
fn threads(config: &Config, plan: &Plan) -> Vec<String> {
    let buses: Vec<&str> = config.bus.iter().map(|section| section.name.as_str()).collect();
    let mut threads = vec![
        format!("main: bus {}, the engine, the signal that ends the daemon", buses.join(", ")),
        "service: subscribers must not hold the engine up".to_owned(),
        "store writer: a slow disk must not hold the engine up".to_owned(),
    ];
    if config.bus.iter().any(|section| section.source == BusSource::Sim) {
        threads.push("sim-bus: the simulated forearm, one for each such bus".to_owned());
    }
    if plan.patches.iter().any(|patch| patch.gauge.is_some()) {
        threads.push("one more while models are fitted".to_owned());
    }
    threads
}

fn left_out_buses(config: &Config, routes: &Routes) -> Vec<String> {
    let unused = config.bus.iter().enumerate().filter(|(bus, _)| routes.wanted(BusIndex(*bus as u8)).is_empty());
    unused
        .map(|(_, section)| format!("bus {}: no board and no gauge is on it: nothing is read", section.name))
        .collect()
}

/// What this build does not have.
fn left_out_of_the_build() -> Vec<String> {
    let features = [
        (cfg!(feature = "sim"), "sim", "the simulated bus and `taxeld demo`"),
        (cfg!(feature = "report"), "report", "`taxeld report`"),
    ];
    let absent = features.iter().filter(|(built, ..)| !built);
    absent.map(|(_, feature, what)| format!("build: {what}: cargo feature `{feature}` is not built in")).collect()
}
