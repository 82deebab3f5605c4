//! Time of a published scan, from frames to snapshot: decoding, judging, zero, force and uncertainty, one thread.
//!
//! `cargo run --release -p taxel-engine --example scan_time [lean|full|ten]`
//!
//! A simulated forearm of 230 taxels bears half a kilogram, in the least scene and in one that asks for everything; then
//! ten patches of 2,080 taxels each on ten full buses, every eighth module pressed. Frames come in batches of 2 ms.

use std::sync::Arc;
use std::time::{Duration, Instant};

use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{Gauge, Outputs, PatchPlan, Plan};
use taxel_engine::record::Record;
use taxel_engine::snapshot::{ForceState, PatchSnapshot};
use taxel_engine::{Engine, Input, Now, Output, Restored};
use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::{BoardsConfig, Config, GaugeConfig, Mass, PumpCommand, Skin, World};
use taxel_skin::{Board, BoardAddress, BusIndex, Geometry, Kilopascal, Module, ModuleKind, Patch, TaxelIndex, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::{Message, StatusWord};

const BATCH: Duration = Duration::from_millis(2);
const BATCHES_PER_TICK: usize = 5;
const REPETITIONS: usize = 40;
const REST: Duration = Duration::from_secs(3);
const LOADED: Duration = Duration::from_secs(10);

type Error = Box<dyn std::error::Error>;
/// Frames that come in one batch on one bus, and when.
type Batch = (Time, BusIndex, Vec<TimedFrame>);

fn main() -> Result<(), Error> {
    let which = std::env::args().nth(1).unwrap_or_default();
    let wanted = |name: &str| which.is_empty() || which == name;
    let set = calibrate()?;
    for (name, full) in [("lean", false), ("full", true)] {
        if wanted(name) {
            let plan = Arc::new(Plan { buses: 1, patches: vec![forearm(full)?] });
            let mut frames = recorded()?;
            let gauge = GaugeConfig::default().signal.id;
            frames.retain(|frame| full || frame.frame.id != gauge); // the kernel's filters keep it away
            measure(name, &plan, &[Arc::clone(&set)], &batches(BusIndex(0), &frames));
        }
    }
    if wanted("ten") {
        let patches = (0..10).map(ten_th).collect::<Result<Vec<_>, _>>()?;
        let sets: Vec<_> = patches.iter().map(|patch| tiled(&set, patch)).collect();
        let mut all: Vec<Batch> = Vec::new();
        for (bus, (patch, set)) in (0..).zip(patches.iter().zip(&sets)) {
            all.extend(batches(BusIndex(bus), &noisy(patch, set)));
        }
        all.sort_by_key(|&(end, bus, _)| (end, bus.0));
        let plan = Arc::new(Plan { buses: 10, patches: patches.into_iter().map(PatchPlan::new).collect() });
        measure("ten buses", &plan, &sets, &all);
    }
    Ok(())
}

/// Plays the same frames to a new engine again and again; the time after the rest counts.
fn measure(name: &str, plan: &Arc<Plan>, sets: &[Arc<ModelSet>], batches: &[Batch]) {
    let (rest, loaded) = batches.split_at(batches.partition_point(|(end, ..)| *end <= Time::default() + REST));
    let frames: usize = loaded.iter().map(|(.., frames)| frames.len()).sum();
    let (mut times_us, mut scans) = (Vec::new(), 0);
    for _ in 0..REPETITIONS {
        let mut engine = engine(plan, sets);
        feed(&mut engine, rest);
        let begun = Instant::now();
        let (published, newest) = feed(&mut engine, loaded);
        times_us.push(begun.elapsed().as_secs_f64() * 1e6);
        scans = published;
        let force = newest.map(|snapshot| snapshot.force.clone()).unwrap_or_default();
        let good = matches!(force.state, ForceState::Ok | ForceState::Degraded) && force.active > 0;
        assert!(good, "nothing is felt: {:?} {:?}", force.state, force.reasons);
    }
    times_us.sort_by(f64::total_cmp);
    let [quick, median] = [times_us[REPETITIONS / 20], times_us[REPETITIONS / 2]];
    let (per_scan, per_frame) = (median / f64::from(scans), frames as f64 / median);
    println!(
        "{name}: {per_scan:.2} us a scan (5 %: {:.2}), {per_frame:.2} million frames/s, {scans} scans, {frames} frames",
        quick / f64::from(scans)
    );
}

fn feed(engine: &mut Engine, batches: &[Batch]) -> (u32, Option<Arc<PatchSnapshot>>) {
    let (mut scans, mut newest, mut out, mut before) = (0, None, Vec::new(), Time::default());
    let mut number = 0;
    for (time, bus, frames) in batches {
        if !frames.is_empty() {
            engine.step(at(*time), Input::Frames(*bus, frames), &mut out);
        }
        if *time > before {
            (number, before) = (number + 1, *time);
            if number % BATCHES_PER_TICK == 0 {
                engine.step(at(*time), Input::Tick, &mut out);
            }
        }
        for output in out.drain(..) {
            if let Output::Patch(_, snapshot) = output {
                (scans, newest) = (scans + 1, Some(snapshot));
            }
        }
    }
    (scans, newest)
}

fn batches(bus: BusIndex, frames: &[TimedFrame]) -> Vec<Batch> {
    let (mut frames, mut end, mut batches) = (frames.iter().copied().peekable(), Time::default(), Vec::new());
    while frames.peek().is_some() {
        end = end + BATCH;
        let mut batch = Vec::new();
        while let Some(frame) = frames.next_if(|frame| frame.time <= end) {
            batch.push(frame);
        }
        batches.push((end, bus, batch));
    }
    batches
}

fn at(time: Time) -> Now {
    Now { time, wall_ns: time.as_nanos() }
}

fn engine(plan: &Arc<Plan>, sets: &[Arc<ModelSet>]) -> Engine {
    let active = sets.iter().map(|set| (set.patch.clone(), set.id.clone())).collect();
    Engine::new(
        Arc::clone(plan),
        Restored { model_sets: sets.iter().cloned().map(Into::into).collect(), active, ..Restored::default() },
    )
}

fn forearm(full: bool) -> Result<PatchPlan, Error> {
    let skin = Skin::forearm()?;
    let patch = skin.patch().clone();
    let geometry = if full { Some(Geometry::parse(&skin.positions_file(), &patch)?) } else { None };
    let all = geometry.is_some();
    Ok(PatchPlan {
        outputs: Outputs { resultant: all, moment: all, contacts: all, fill: all, place: all },
        geometry,
        gauge: full.then(|| Gauge::new(BusIndex(0), GaugeConfig::default().signal)),
        fit: FitOptions {
            gauge: GaugeUncertainty { gain_rel: 0.0025, offset_kpa: 0.05, noise_kpa: 0.02 },
            ..FitOptions::default()
        },
        ..PatchPlan::new(patch)
    })
}

fn world() -> Result<World, Error> {
    let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
    Ok(World::new(Skin::forearm()?, Config { boards, ..Config::seeded(1) }))
}

/// Frames at rest, then under half a kilogram.
fn recorded() -> Result<Vec<TimedFrame>, Error> {
    let (mut world, mut frames) = (world()?, Vec::new());
    world.advance(Time::default() + REST, &mut frames);
    world.lay(Mass::on_disc(0.5, TaxelIndex(100), 600.0))?;
    world.advance(Time::default() + REST + LOADED, &mut frames);
    Ok(frames)
}

/// The models that a session over one ramp gives.
fn calibrate() -> Result<Arc<ModelSet>, Error> {
    let plan = Arc::new(Plan { buses: 1, patches: vec![forearm(true)?] });
    let (mut engine, mut world, mut time) = (engine(&plan, &[]), world()?, Time::default());
    let (mut begun, mut pumping) = (false, false);
    loop {
        time = time + Duration::from_millis(10);
        let (mut frames, mut out) = (Vec::new(), Vec::new());
        world.advance(time, &mut frames);
        engine.step(at(time), Input::Frames(BusIndex(0), &frames), &mut out);
        engine.step(at(time), Input::Tick, &mut out);
        if !begun && time > Time::default() + Duration::from_secs(1) {
            begun = true;
            let start = Command::StartSession {
                patch: String::new(),
                target: None,
                branches: None,
                confirmed_by: None,
                leave_out: Vec::new(),
            };
            engine.step(at(time), Input::Command(RequestId(1), start), &mut out);
        }
        let mut next = out;
        while !next.is_empty() {
            let mut later = Vec::new();
            for output in next {
                match output {
                    Output::Session(_, view) if view.state == SessionState::Ramping && !pumping => {
                        pumping = true;
                        world.pump(PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 4.0 });
                    }
                    Output::Commit { ticket, records } => {
                        if let Some(Record::ModelSet(set)) = records.first() {
                            return Ok(Arc::clone(set));
                        }
                        engine.step(at(time), Input::Committed { ticket, result: Ok(()) }, &mut later);
                    }
                    Output::Fit(job) => {
                        let fitted = Input::Fitted(job.run(|_| "m-example".to_owned()));
                        engine.step(at(time), fitted, &mut later);
                    }
                    _ => {}
                }
            }
            next = later;
        }
        if time > Time::default() + Duration::from_secs(120) {
            return Err("the calibration did not come to its end".into());
        }
    }
}

fn ten_th(bus: u8) -> Result<Patch, Error> {
    let modules = || (0..16).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
    let board = |address: u8| {
        Ok::<_, Error>(Board { bus: BusIndex(bus), address: BoardAddress::new(address)?, modules: modules() })
    };
    Ok(Patch::new(format!("patch{bus}"), (1..=13).map(board).collect::<Result<Vec<_>, _>>()?)?)
}

/// The forearm's models over and over.
fn tiled(forearm: &ModelSet, patch: &Patch) -> Arc<ModelSet> {
    let taxels = patch.taxels().len();
    Arc::new(ModelSet {
        id: format!("m-{}", patch.name()),
        patch: patch.name().to_owned(),
        board_settings: Vec::new(), // those of the forearm are of other boards
        baseline: forearm.baseline.iter().cycle().take(taxels).copied().collect(),
        taxels: forearm.taxels.iter().cycle().take(taxels).cloned().collect(),
        ..forearm.clone()
    })
}

/// Thirteen seconds of a full bus: each taxel's rest with its noise, later every eighth module pressed.
fn noisy(patch: &Patch, set: &ModelSet) -> Vec<TimedFrame> {
    let (period, mut bits) = (Duration::from_millis(50), 0x9E37_79B9_7F4A_7C15_u64);
    let mut chance = || {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let (apart, mut frames) = (period / (2 * patch.modules().len() as u32), Vec::new());
    let mut time = Time::default();
    for scan in 0..(REST + LOADED).as_millis() / period.as_millis() {
        for (number, site) in patch.modules().iter().enumerate() {
            let loaded = scan > REST.as_millis() / period.as_millis();
            let pressed = if loaded && number % 8 == 0 { 20.0 } else { 0.0 };
            let mut values = [0_u8; 12];
            for (&slot, rest) in site.kind.taxel_slots().iter().zip(&set.baseline[usize::from(site.first_taxel)..]) {
                let noise: f64 = (0..3).map(|_| chance()).sum();
                values[usize::from(slot)] = (rest.mean + rest.noise * noise - pressed).round().clamp(0.0, 255.0) as u8;
            }
            let (board, module) = (patch.boards()[usize::from(site.board)].address, site.module);
            let [v0, v1, v2, v3, v4, v5, v6, tail @ ..] = values;
            let head = Message::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] };
            let tail = Message::Tail { board, module, values: tail, status: StatusWord(0) };
            for message in [head, tail] {
                time = time + apart;
                frames.push(TimedFrame { time, frame: message.encode() });
            }
        }
    }
    frames
}
