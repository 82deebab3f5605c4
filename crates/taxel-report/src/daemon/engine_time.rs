//! What the engine alone takes for a scan in the full and in the lean scene, on the same frames.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::ensure;
use taxel_engine::engine::routes::Route;
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::{ForceState, PatchSnapshot};
use taxel_engine::{Engine, Input, Output};
use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;

use super::figures::{quantile, sorted};
use super::process::Scene;
use super::rig;
use crate::options::Options;

const BUS: BusIndex = BusIndex(0);
/// Frames come in batches of a few, and the engine looks at the time, as in the daemon.
const BATCH: Duration = Duration::from_millis(2);
const BATCHES_PER_TICK: usize = 5;
/// The zero is taken in this time.
const REST: Duration = Duration::from_secs(3);
const LOADED: Duration = Duration::from_secs(10);

/// A scene's share in it.
#[derive(Clone, Debug)]
pub struct EngineTime {
    /// Per scan in us, ascending, one value a repetition.
    pub per_scan_us: Vec<f64>,
    /// Identifiers that the kernel lets through.
    pub identifiers: usize,
    /// Frames a second that pass, and all there are.
    pub frames_per_s: [f64; 2],
}

impl EngineTime {
    /// Median in us.
    pub fn median_us(&self) -> f64 {
        quantile(&self.per_scan_us, 0.5)
    }
}

/// Times both scenes in turn; full first.
///
/// # Errors
/// If one of them comes to no force, which would make its time worthless.
pub fn per_scan(options: &Options, set: &Arc<ModelSet>) -> anyhow::Result<[EngineTime; 2]> {
    let (frames, laid) = rig::recorded(options.seed, REST, LOADED)?;
    let scenes = [Playback::new(Scene::Full, &frames)?, Playback::new(Scene::Lean, &frames)?];
    let mut times = [Vec::new(), Vec::new()];
    for repetition in 0..=if options.quick { 15 } else { 30 } {
        for (scene, times) in scenes.iter().zip(&mut times) {
            let us = scene.play(set, laid)?;
            // The first is the warm-up.
            times.extend((repetition > 0).then_some(us));
        }
    }
    let all_per_s = frames.len() as f64 / (REST + LOADED).as_secs_f64();
    let mut times = times.into_iter();
    Ok(scenes.map(|scene| EngineTime {
        per_scan_us: sorted(times.next().unwrap_or_default()),
        identifiers: scene.identifiers,
        frames_per_s: [scene.passed as f64 / (REST + LOADED).as_secs_f64(), all_per_s],
    }))
}

/// The frames that reach one scene's engine, in batches.
struct Playback {
    plan: Arc<Plan>,
    batches: Vec<(Time, Vec<TimedFrame>)>,
    identifiers: usize,
    passed: usize,
}

impl Playback {
    fn new(scene: Scene, frames: &[TimedFrame]) -> anyhow::Result<Self> {
        let plan = rig::forearm(scene)?;
        let engine = rig::engine(&plan, &[]);
        // What the kernel's filters keep away never wakes the process.
        let passes = |frame: &&TimedFrame| engine.routes().of(BUS, frame.frame.id) != Route::Foreign;
        let mut frames = frames.iter().filter(passes).copied().peekable();
        let (mut batches, mut end, mut passed) = (Vec::new(), Time::default(), 0);
        while frames.peek().is_some() {
            end = end + BATCH;
            let mut batch = Vec::new();
            while let Some(frame) = frames.next_if(|frame| frame.time <= end) {
                batch.push(frame);
            }
            passed += batch.len();
            batches.push((end, batch));
        }
        let identifiers = engine.routes().wanted(BUS).len();
        Ok(Self { plan, batches, identifiers, passed })
    }

    /// Time per published scan in us, from `from` on.
    fn play(&self, set: &Arc<ModelSet>, from: Time) -> anyhow::Result<f64> {
        let mut engine = rig::engine(&self.plan, &[Arc::clone(set)]);
        let (rest, loaded) = self.batches.split_at(self.batches.partition_point(|(end, _)| *end <= from));
        feed(&mut engine, rest);
        let begun = Instant::now();
        let (scans, newest) = feed(&mut engine, loaded);
        let us = begun.elapsed().as_secs_f64() * 1e6;
        let force = newest.as_ref().map(|snapshot| &snapshot.force);
        let good = force.is_some_and(|f| matches!(f.state, ForceState::Ok | ForceState::Degraded) && f.active > 0);
        ensure!(good, "the timed engine feels nothing under the mass: {:?}", force.map(|f| (f.state, &f.reasons)));
        Ok(us / f64::from(scans))
    }
}

fn feed(engine: &mut Engine, batches: &[(Time, Vec<TimedFrame>)]) -> (u32, Option<Arc<PatchSnapshot>>) {
    let (mut scans, mut newest, mut out) = (0, None, Vec::new());
    for (number, (time, frames)) in batches.iter().enumerate() {
        if !frames.is_empty() {
            engine.step(rig::at(*time), Input::Frames(BUS, frames), &mut out);
        }
        if number % BATCHES_PER_TICK == 0 {
            engine.step(rig::at(*time), Input::Tick, &mut out);
        }
        for output in out.drain(..) {
            if let Output::Patch(_, snapshot) = output {
                (scans, newest) = (scans + 1, Some(snapshot));
            }
        }
    }
    (scans, newest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lean_scene_lets_fewer_frames_through_and_both_feel_the_mass() {
        let (frames, laid) = rig::recorded(1, REST, Duration::from_secs(1)).unwrap();
        let set = rig::calibrate(1).unwrap();
        let [full, lean] = [Scene::Full, Scene::Lean].map(|scene| Playback::new(scene, &frames).unwrap());
        assert_eq!(full.passed, frames.len(), "the full scene has a use for every frame of this bus");
        let gauge = frames.iter().filter(|f| f.frame.id == taxel_wire::CanId::Standard(0x3A1)).count();
        assert_eq!(lean.passed, frames.len() - gauge);
        assert_eq!(lean.identifiers, full.identifiers - 1);
        assert!(full.play(&set, laid).is_ok() && lean.play(&set, laid).is_ok());
    }
}
