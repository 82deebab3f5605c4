//! Frames to snapshots: a calibrated forearm with a load on it, everything computed, one thread.
//!
//! `cargo bench -p taxel-report --bench frames`
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use taxel_engine::plan::{Outputs, PatchPlan, Plan};
use taxel_engine::snapshot::ForceState;
use taxel_engine::{Engine, Input, Now, Output, Restored};
use taxel_model::FitOptions;
use taxel_report::held_out::fits::Calibration;
use taxel_report::held_out::forearm::{Forearm, Scan};
use taxel_skin::{BusIndex, Time};
use taxel_wire::TimedFrame;

/// The daemon ticks this often; what came meanwhile is one batch.
const TICK: Duration = Duration::from_millis(10);

/// The stretch of frames that is played again and again: forty scans.
const STRETCH_S: f64 = 2.0;

/// An engine with a force, and what it is given from then on.
struct Bench {
    engine: Engine,
    now: Time,
    frames: Vec<TimedFrame>,
    out: Vec<Output>,
    snapshots: u64,
    state: ForceState,
}

impl Bench {
    /// A forearm that was calibrated, vented and tared, and bears 0.5 kg.
    fn new(outputs: Outputs) -> Self {
        let mut forearm = Forearm::new(1).unwrap();
        let plan = PatchPlan { outputs, ..forearm.plan().unwrap() };
        let rest = forearm.rest();
        let scans = forearm.ramp(70.0, 4.0);
        let calibration = Calibration::new(&forearm, rest, &scans.iter().collect::<Vec<&Scan>>());
        let set = calibration.model_set(calibration.fit(&FitOptions::default()), &plan);
        forearm.vent();
        let restored = Restored {
            active: vec![(set.patch.clone(), set.id.clone())],
            model_sets: vec![Arc::new(set).into()],
            ..Restored::default()
        };
        let engine = Engine::new(Arc::new(Plan { buses: 1, patches: vec![plan] }), restored);
        let (out, state) = (Vec::new(), ForceState::default());
        let mut bench = Self { engine, now: forearm.now(), frames: Vec::new(), out, snapshots: 0, state };
        let before = forearm.frames(STRETCH_S);
        bench.play(&before);
        forearm.lay(0.5, 100).unwrap();
        let settling = forearm.frames(STRETCH_S);
        bench.play(&settling);
        bench.frames = forearm.frames(STRETCH_S);
        bench.again();
        bench.check();
        bench
    }

    fn check(&self) {
        let good = matches!(self.state, ForceState::Ok | ForceState::Degraded);
        assert!(good && self.snapshots > 0, "{:?} after {} snapshots: nothing is measured", self.state, self.snapshots);
    }

    /// Frames of one stretch, a batch and a tick every 10 ms.
    fn play(&mut self, mut frames: &[TimedFrame]) {
        let end = self.now + Duration::from_secs_f64(STRETCH_S);
        while self.now < end {
            self.now = self.now + TICK;
            let (batch, later) = frames.split_at(frames.partition_point(|frame| frame.time <= self.now));
            frames = later;
            self.step(Input::Frames(BusIndex(0), batch));
            self.step(Input::Tick);
        }
    }

    fn step(&mut self, input: Input<'_>) {
        let now = Now { time: self.now, wall_ns: self.now.as_nanos() };
        self.engine.step(now, input, &mut self.out);
        for output in self.out.drain(..) {
            if let Output::Patch(_, snapshot) = &output {
                self.snapshots += 1;
                self.state = snapshot.force.state;
            }
            black_box(output);
        }
    }

    /// The next stretch, which is the same frames as if time went on; how long the engine took.
    fn again(&mut self) -> Duration {
        let mut frames = std::mem::take(&mut self.frames);
        let begun = Instant::now();
        self.play(&frames);
        let took = begun.elapsed();
        for frame in &mut frames {
            frame.time = frame.time + Duration::from_secs_f64(STRETCH_S);
        }
        self.frames = frames;
        took
    }
}

fn frames(c: &mut Criterion) {
    let mut group = c.benchmark_group("frames to snapshots");
    let all = Outputs { resultant: true, moment: true, contacts: true, fill: true };
    for (name, outputs) in [("total alone", Outputs::default()), ("everything", all)] {
        let mut bench = Bench::new(outputs);
        group.throughput(Throughput::Elements(bench.frames.len() as u64));
        group.bench_function(name, |b| b.iter_custom(|times| (0..times).map(|_| bench.again()).sum()));
        bench.check();
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
