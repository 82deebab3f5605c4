//! A simulated forearm and an engine on data alone: models for the daemon, and frames to time the engine with.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use taxel_engine::calibration::SessionState;
use taxel_engine::command::{Command, RequestId};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{Gauge, Outputs, PatchPlan, Plan};
use taxel_engine::record::Record;
use taxel_engine::{Engine, Input, Now, Output, Restored};
use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::{BoardsConfig, Config, GaugeConfig, Mass, PumpCommand, Skin, World};
use taxel_skin::{BusIndex, Geometry, Kilopascal, Patch, TaxelIndex, Time};
use taxel_store::models_json::content_id;
use taxel_wire::TimedFrame;

use super::process::Scene;

/// Frames are handed over this often.
const STEP: Duration = Duration::from_millis(10);

/// A little beyond the range that is calibrated, as fast as a session takes it.
const RAMP: PumpCommand = PumpCommand::Ramp { target: Kilopascal(74.0), kpa_per_s: 4.0 };

/// Simulated time within which a calibration is over, or never will be.
const PATIENCE: Duration = Duration::from_secs(120);

/// The plan of a scene, as the daemon makes it of its configuration; boards are expected to stream.
///
/// # Errors
/// If the simulator's own position file cannot be read.
pub fn patch_plan(scene: Scene, patch: Patch, positions: Option<&str>) -> anyhow::Result<PatchPlan> {
    let full = scene == Scene::Full;
    let geometry = positions.filter(|_| full).map(|text| Geometry::parse(text, &patch)).transpose()?;
    let directed = geometry.is_some();
    Ok(PatchPlan {
        outputs: Outputs { resultant: directed, moment: directed, contacts: directed, fill: directed },
        geometry,
        gauge: full.then(|| Gauge { bus: BusIndex(0), signal: GaugeConfig::default().signal }),
        fit: FitOptions {
            gauge: GaugeUncertainty { gain_rel: 0.0025, offset_kpa: 0.05, noise_kpa: 0.02 },
            ..FitOptions::default()
        },
        ..PatchPlan::new(patch)
    })
}

/// The forearm in a scene.
///
/// # Errors
/// As [`patch_plan`].
pub fn forearm(scene: Scene) -> anyhow::Result<Arc<Plan>> {
    let skin = Skin::forearm()?;
    let patch = patch_plan(scene, skin.patch().clone(), Some(&skin.positions_file()))?;
    Ok(Arc::new(Plan { buses: 1, patches: vec![patch] }))
}

/// An engine that uses `set` from the start on.
pub fn engine(plan: &Arc<Plan>, sets: &[Arc<ModelSet>]) -> Engine {
    let active = sets.iter().map(|set| (set.patch.clone(), set.id.clone())).collect();
    Engine::new(
        Arc::clone(plan),
        Restored { model_sets: sets.iter().cloned().map(Into::into).collect(), active, ..Restored::default() },
    )
}

/// The present of virtual time.
pub fn at(time: Time) -> Now {
    Now { time, wall_ns: time.as_nanos() }
}

/// A world whose boards stream from the first moment.
///
/// # Errors
/// If the simulator's own defaults contradict each other.
pub fn world(seed: u64) -> anyhow::Result<World> {
    let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
    Ok(World::new(Skin::forearm()?, Config { boards, ..Config::seeded(seed) })?)
}

/// What the daemon of this seed would get from a calibration: the same skin, the same rules, in virtual time.
///
/// # Errors
/// If the calibration does not come to its end.
pub fn calibrate(seed: u64) -> anyhow::Result<Arc<ModelSet>> {
    let mut run = Run {
        engine: engine(&forearm(Scene::Full)?, &[]),
        world: world(seed)?,
        now: Time::default(),
        state: None,
        set: None,
    };
    run.advance(Duration::from_secs(1))?;
    let start = Command::StartSession {
        patch: String::new(),
        target: None,
        branches: None,
        confirmed_by: None,
        leave_out: Vec::new(),
    };
    run.step(Input::Command(RequestId(1), start))?;
    let (mut pumping, end) = (false, run.now + PATIENCE);
    while run.set.is_none() {
        run.advance(STEP)?;
        if !pumping && run.state == Some(SessionState::Ramping) {
            pumping = true;
            run.world.pump(RAMP);
        }
        if run.now > end {
            bail!(
                "the simulated calibration did not end within {} s, its state is {:?}",
                PATIENCE.as_secs(),
                run.state
            );
        }
    }
    run.set.context("the fit gave no models")
}

/// A calibration in virtual time.
struct Run {
    engine: Engine,
    world: World,
    now: Time,
    state: Option<SessionState>,
    set: Option<Arc<ModelSet>>,
}

impl Run {
    fn advance(&mut self, span: Duration) -> anyhow::Result<()> {
        let (end, mut frames) = (self.now + span, Vec::new());
        while self.now < end {
            self.now = self.now + STEP;
            frames.clear();
            self.world.advance(self.now, &mut frames);
            self.step(Input::Frames(BusIndex(0), &frames))?;
            self.step(Input::Tick)?;
        }
        Ok(())
    }

    fn step(&mut self, input: Input<'_>) -> anyhow::Result<()> {
        let (mut out, mut fits, mut commits) = (Vec::new(), Vec::new(), Vec::new());
        self.engine.step(at(self.now), input, &mut out);
        for output in out {
            match output {
                Output::Session(_, view) => self.state = Some(view.state),
                Output::Commit { ticket, records } => {
                    let sets = records.into_iter().filter_map(|record| match record {
                        Record::ModelSet(set) => Some(set),
                        _ => None,
                    });
                    self.set = sets.last().or(self.set.take());
                    commits.push(ticket);
                }
                Output::Fit(job) => fits.push(job),
                Output::Reply(_, reply) => drop(reply.map_err(|rejection| anyhow!("{rejection}"))?),
                _ => {}
            }
        }
        for ticket in commits {
            self.step(Input::Committed { ticket, result: Ok(()) })?;
        }
        fits.into_iter().try_for_each(|job| self.step(Input::Fitted(job.run(content_id))))
    }
}

/// Frames of the forearm: some seconds at rest, then under half a kilogram; and the time at which it was laid down.
///
/// # Errors
/// If the mass cannot lie where it is put.
pub fn recorded(seed: u64, rest: Duration, loaded: Duration) -> anyhow::Result<(Vec<TimedFrame>, Time)> {
    let (mut world, mut frames) = (world(seed)?, Vec::new());
    let laid = Time::default() + rest;
    world.advance(laid, &mut frames);
    world.lay(Mass::on_disc(0.5, TaxelIndex(100), 600.0))?;
    world.advance(laid + loaded, &mut frames);
    Ok((frames, laid))
}

/// Share of a core that the simulated bus takes in real time, when it is looked at as often as the daemon looks.
///
/// # Errors
/// As [`world`].
pub fn simulator_share(seed: u64) -> anyhow::Result<f64> {
    let (look, simulated) = (Duration::from_millis(2), Duration::from_secs(5));
    let (mut world, mut frames, mut now) = (world(seed)?, Vec::new(), Time::default());
    let begun = std::time::Instant::now();
    while now < Time::default() + simulated {
        now = now + look;
        frames.clear();
        world.advance(now, &mut frames);
        std::hint::black_box(&frames);
    }
    Ok(begun.elapsed().as_secs_f64() / simulated.as_secs_f64())
}
