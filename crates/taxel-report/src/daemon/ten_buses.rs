//! Ten full buses into one engine: how much of a core that takes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::ensure;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::ForceState;
use taxel_engine::{Engine, Input, Output};
use taxel_skin::{Board, BoardAddress, BusIndex, Module, ModuleKind, Patch, Time};
use taxel_wire::icub::{Message, StatusWord};
use taxel_wire::{Frame, TimedFrame};

use super::figures::sorted;
use super::process::Scene;
use super::rig;
use crate::options::Options;

const BUSES: u8 = 10;
/// Thirteen boards of sixteen modules send 416 frames in 50 ms, one every 120 us: a bus that is full.
const BOARDS: u8 = 13;
const MODULES: u8 = 16;
const PERIOD: Duration = Duration::from_millis(50);
/// A bus's task hands over what has come in this time.
const BATCH: Duration = Duration::from_millis(2);
const BATCHES_PER_SCAN: usize = 25;
const BATCHES_PER_TICK: usize = 5;
/// The zero is taken in this time.
const REST_SCANS: usize = 60;
/// A second of bus time is one repetition.
const SCANS_PER_S: usize = 20;
/// Counts by which every eighth module is pressed once the zero is there.
const PRESSED_COUNTS: f64 = 20.0;

/// What it takes.
pub struct TenBuses {
    /// Share of a core, ascending, one value a second of bus time.
    pub shares: Vec<f64>,
    /// Frames a second over all buses.
    pub frames_per_s: f64,
    /// Taxels of all patches.
    pub taxels: usize,
    /// Snapshots published a second.
    pub snapshots_per_s: f64,
}

/// Times the engine on frames of ten full buses, one patch on each, all of them calibrated, tared and touched.
///
/// # Errors
/// If a patch comes to no force, which would make the time worthless.
pub fn measure(options: &Options, forearm: &ModelSet) -> anyhow::Result<TenBuses> {
    let seconds = if options.quick { 15 } else { 30 };
    let patches = (0..BUSES).map(patch).collect::<anyhow::Result<Vec<_>>>()?;
    let sets: Vec<Arc<ModelSet>> = patches.iter().map(|patch| tiled(forearm, patch)).collect();
    let taxels = patches.iter().map(|patch| patch.taxels().len()).sum();
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let plans = patches.into_iter().map(|patch| rig::patch_plan(Scene::Lean, patch, None));
    let plan = Arc::new(Plan { buses: usize::from(BUSES), patches: plans.collect::<anyhow::Result<_>>()? });
    let mut run =
        Run { engine: rig::engine(&plan, &sets), scan: 0, good: vec![false; plan.patches.len()], snapshots: 0 };
    for _ in 0..REST_SCANS {
        run.scan(&plan, &sets, &mut rng, 0.0);
    }
    run.snapshots = 0;
    let (mut shares, mut frames) = (Vec::new(), 0);
    for _ in 0..seconds {
        let mut spent = Duration::ZERO;
        for _ in 0..SCANS_PER_S {
            let (took, count) = run.scan(&plan, &sets, &mut rng, PRESSED_COUNTS);
            spent += took;
            frames += count;
        }
        shares.push(spent.as_secs_f64());
    }
    ensure!(
        run.good.iter().all(|good| *good),
        "a patch of the ten buses has no force or feels nothing: {:?}",
        run.good
    );
    Ok(TenBuses {
        shares: sorted(shares),
        frames_per_s: frames as f64 / f64::from(seconds),
        taxels,
        snapshots_per_s: f64::from(run.snapshots) / f64::from(seconds),
    })
}

fn patch(bus: u8) -> anyhow::Result<Patch> {
    let board = |address: u8| {
        let modules = (0..MODULES).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
        Ok(Board { bus: BusIndex(bus), address: BoardAddress::new(address)?, modules })
    };
    let boards = (1..=BOARDS).map(board).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Patch::new(format!("patch{bus}"), boards)?)
}

/// The forearm's models over and over.
fn tiled(forearm: &ModelSet, patch: &Patch) -> Arc<ModelSet> {
    let taxels = patch.taxels().len();
    Arc::new(ModelSet {
        id: format!("m-{}", patch.name()),
        patch: patch.name().to_owned(),
        baseline: forearm.baseline.iter().cycle().take(taxels).copied().collect(),
        taxels: forearm.taxels.iter().cycle().take(taxels).cloned().collect(),
        ..forearm.clone()
    })
}

struct Run {
    engine: Engine,
    scan: usize,
    /// Which patches feel a force.
    good: Vec<bool>,
    snapshots: u32,
}

impl Run {
    /// One scan of every bus: the engine's time and the number of frames.
    fn scan(
        &mut self,
        plan: &Plan,
        sets: &[Arc<ModelSet>],
        rng: &mut ChaCha8Rng,
        pressed_counts: f64,
    ) -> (Duration, usize) {
        let begin = Time::default() + PERIOD * self.scan as u32;
        self.scan += 1;
        let buses: Vec<Vec<Frame>> =
            plan.patches.iter().zip(sets).map(|(plan, set)| frames(&plan.patch, set, rng, pressed_counts)).collect();
        let (mut spent, mut count, mut out) = (Duration::ZERO, 0, Vec::new());
        for batch in 0..BATCHES_PER_SCAN {
            let end = begin + BATCH * (batch as u32 + 1);
            for (bus, frames) in buses.iter().enumerate() {
                let frames = received(frames, begin, batch);
                count += frames.len();
                let begun = Instant::now();
                self.engine.step(rig::at(end), Input::Frames(BusIndex(bus as u8), &frames), &mut out);
                self.note(&mut out);
                spent += begun.elapsed();
            }
            if batch % BATCHES_PER_TICK == 0 {
                let begun = Instant::now();
                self.engine.step(rig::at(end), Input::Tick, &mut out);
                self.note(&mut out);
                spent += begun.elapsed();
            }
        }
        (spent, count)
    }

    fn note(&mut self, out: &mut Vec<Output>) {
        for output in out.drain(..) {
            if let Output::Patch(patch, snapshot) = output {
                let force = &snapshot.force;
                self.good[patch] = matches!(force.state, ForceState::Ok | ForceState::Degraded) && force.active > 0;
                self.snapshots += 1;
            }
        }
    }
}

/// Frames of batch number `batch`, evenly spread over the scan.
fn received(frames: &[Frame], begin: Time, batch: usize) -> Vec<TimedFrame> {
    let share = |batch: usize| batch * frames.len() / BATCHES_PER_SCAN;
    let apart = PERIOD / frames.len() as u32;
    let timed = |index: usize| TimedFrame { time: begin + apart * index as u32, frame: frames[index] };
    (share(batch)..share(batch + 1)).map(timed).collect()
}

/// One scan of a patch: its rest with the noise it had, every eighth module pressed by so many counts.
fn frames(patch: &Patch, set: &ModelSet, rng: &mut ChaCha8Rng, pressed_counts: f64) -> Vec<Frame> {
    let mut frames = Vec::with_capacity(2 * patch.modules().len());
    for (number, site) in patch.modules().iter().enumerate() {
        let pressed = if number % 8 == 0 { pressed_counts } else { 0.0 };
        let mut values = [0_u8; 12];
        for (&slot, rest) in site.kind.taxel_slots().iter().zip(&set.baseline[usize::from(site.first_taxel)..]) {
            // The sum of three even chances is near enough to the noise of a converter.
            let noise: f64 = (0..3).map(|_| rng.random_range(-1.0..1.0)).sum();
            values[usize::from(slot)] = (rest.mean + rest.noise * noise - pressed).round().clamp(0.0, 255.0) as u8;
        }
        let (board, module) = (patch.boards()[usize::from(site.board)].address, site.module);
        let [v0, v1, v2, v3, v4, v5, v6, tail @ ..] = values;
        frames.push(Message::Head { board, module, values: [v0, v1, v2, v3, v4, v5, v6] }.encode());
        frames.push(Message::Tail { board, module, values: tail, status: StatusWord(0) }.encode());
    }
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_is_full_and_its_batches_hold_every_frame_once_in_order() {
        let forearm = rig::calibrate(1).unwrap();
        let patch = patch(3).unwrap();
        let set = tiled(&forearm, &patch);
        let frames = frames(&patch, &set, &mut ChaCha8Rng::seed_from_u64(1), 0.0);
        assert_eq!(frames.len(), 416);
        let begin = Time::default() + PERIOD;
        let all: Vec<TimedFrame> = (0..BATCHES_PER_SCAN).flat_map(|batch| received(&frames, begin, batch)).collect();
        assert_eq!(all.iter().map(|timed| timed.frame).collect::<Vec<_>>(), frames);
        assert!(all.is_sorted_by_key(|timed| timed.time));
        assert!(all.iter().all(|timed| timed.time >= begin && timed.time < begin + PERIOD));
    }
}
