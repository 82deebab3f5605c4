//! `taxeld demo`: the whole procedure on a simulated forearm, and how far the force is off.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow, bail};
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::{Command, Done};
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::ForceState;
use taxel_sim::{Config, Mass, PumpCommand, Skin, World};
use taxel_skin::{BusIndex, Kilopascal, TaxelIndex, Time};
use taxel_wire::TimedFrame;

use crate::offline::Offline;

/// Step of the simulation: a bus delivers frames this often.
const STEP: Duration = Duration::from_millis(10);

/// The masses of the paper's validation, in kilogram.
pub const MASSES_KG: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// The area that a mass lies on, in mm2: a disc of 28 mm, about 18 taxels.
const FOOTPRINT_MM2: f64 = 600.0;

/// Places that each mass is laid on, spread over the forearm.
const PLACES: usize = 4;

/// A little beyond the range that is used live, so that its end is not a clamp.
const PUMP_TARGET: Kilopascal = Kilopascal(74.0);
const PUMP_KPA_PER_S: f64 = 1.0;

/// One weighing.
pub struct Weighing {
    /// The mass.
    pub kilogram: f64,
    /// What it presses with.
    pub true_n: f64,
    /// What the daemon reports, mean of ten scans.
    pub measured_n: f64,
    /// Its standard uncertainty as the daemon reports it.
    pub sigma_n: f64,
}

impl Weighing {
    /// Error relative to the truth.
    pub fn error(&self) -> f64 {
        self.measured_n / self.true_n - 1.0
    }
}

/// What one skin's procedure came to.
pub struct Outcome {
    /// The session after its fit.
    pub session: SessionView,
    /// The model set.
    pub models: Arc<taxel_engine::model_set::ModelSet>,
    /// All weighings.
    pub weighings: Vec<Weighing>,
}

impl Outcome {
    /// Mean absolute error over all weighings, relative.
    pub fn mean_error(&self) -> f64 {
        mean(self.weighings.iter().map(|w| w.error().abs()))
    }
}

/// Mean of some numbers; NaN of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}

/// A simulated forearm on a simulated bus, and the engine that listens to it.
struct Bench {
    world: World,
    offline: Offline,
    frames: Vec<TimedFrame>,
    now: Time,
}

impl Bench {
    fn new(plan: Arc<Plan>, seed: u64) -> anyhow::Result<Self> {
        let world = World::new(Skin::forearm()?, Config::seeded(seed))?;
        let mut offline = Offline::new(plan);
        offline.advance(Time::default());
        Ok(Self { world, offline, frames: Vec::new(), now: Time::default() })
    }

    fn run(&mut self, span: Duration) {
        let end = self.now + span;
        while self.now < end {
            self.now = self.now + STEP;
            self.frames.clear();
            self.world.advance(self.now, &mut self.frames);
            self.offline.frames(BusIndex(0), &self.frames);
            self.offline.advance(self.now);
            for (_, frame) in self.offline.to_send.drain(..) {
                self.world.send(self.now, &frame);
            }
        }
    }

    fn run_until(&mut self, limit: Duration, what: &str, done: impl Fn(&Self) -> bool) -> anyhow::Result<()> {
        let end = self.now + limit;
        while !done(self) {
            if self.now >= end {
                bail!("{what} did not happen within {} s of simulated time", limit.as_secs());
            }
            self.run(STEP);
        }
        Ok(())
    }

    fn session(&self) -> anyhow::Result<Arc<SessionView>> {
        self.offline.sessions.first().cloned().flatten().context("there is no session")
    }

    fn in_state(&self, state: SessionState) -> bool {
        self.session().is_ok_and(|s| s.state == state)
    }

    fn command(&mut self, command: Command) -> anyhow::Result<Option<Done>> {
        match self.offline.command(command) {
            None => Ok(None),
            Some(Ok(done)) => Ok(Some(done)),
            Some(Err(rejection)) => Err(anyhow!("{rejection}")),
        }
    }

    /// Bag, ramp, fit: the calibration of the paper.
    fn calibrate(&mut self) -> anyhow::Result<String> {
        self.run_until(Duration::from_secs(5), "board bring-up", |b| {
            let boards = &b.offline.health.boards;
            !boards.is_empty() && boards.iter().all(|board| board.bring_up == "verified")
        })?;
        self.command(Command::StartSession {
            patch: String::new(),
            target: None,
            branches: None,
            confirmed_by: None,
            leave_out: Vec::new(),
        })?;
        self.run_until(Duration::from_secs(10), "proof of rest", |b| b.in_state(SessionState::Ramping))?;
        self.world.pump(PumpCommand::Ramp { target: PUMP_TARGET, kpa_per_s: PUMP_KPA_PER_S });
        let limit = Duration::from_secs(300);
        self.run_until(limit, "the end of the ramp", |b| {
            !b.in_state(SessionState::Ramping) && !b.in_state(SessionState::Fitting)
        })?;
        let session = self.session()?;
        let Some(id) = session.model_set.as_deref().filter(|_| session.state == SessionState::Review) else {
            bail!("session {} is {}: {}", session.number, session.state.name(), session.reason);
        };
        self.world.pump(PumpCommand::Vent);
        let (patch, model_set) = (String::new(), id.to_owned());
        self.command(Command::Activate { patch, model_set: model_set.clone(), expected: None })?;
        Ok(model_set)
    }

    fn tare(&mut self) -> anyhow::Result<()> {
        let mut done = self.command(Command::Tare { patch: String::new(), confirmed_by: None })?;
        while done.is_none() {
            self.run(STEP);
            done = self.offline.take_reply().transpose().map_err(|rejection| anyhow!("{rejection}"))?;
        }
        Ok(())
    }

    /// Lays a mass down, lets it settle, and reads ten scans.
    fn weigh(&mut self, kilogram: f64, centre: TaxelIndex) -> anyhow::Result<Weighing> {
        let force = self.world.lay(Mass::on_disc(kilogram, centre, FOOTPRINT_MM2))?;
        self.run(Duration::from_secs(1));
        let (mut measured_n, mut sigma_n) = (0.0, 0.0);
        for _ in 0..10 {
            self.run(Duration::from_millis(50));
            let sample = &self.offline.snapshots[0].force;
            let good = matches!(sample.state, ForceState::Ok | ForceState::Degraded);
            let total = sample.total.filter(|_| good).with_context(|| format!("no force: {:?}", sample.reasons))?;
            measured_n += total.0 / 10.0;
            sigma_n += sample.total_sigma.map_or(f64::NAN, |s| s.0) / 10.0;
        }
        self.world.clear();
        self.run(Duration::from_secs(2));
        Ok(Weighing { kilogram, true_n: force.0, measured_n, sigma_n })
    }
}

/// The whole procedure on the skin of one seed.
pub fn procedure(plan: &Arc<Plan>, seed: u64, progress: &dyn Fn(&str)) -> anyhow::Result<Outcome> {
    let mut bench = Bench::new(Arc::clone(plan), seed)?;
    progress("calibrating: ramp from 0 to 70 kPa");
    let id = bench.calibrate()?;
    let session = SessionView::clone(&*bench.session()?);
    let models = bench.offline.model_sets.iter().find(|set| set.id == id).cloned().context("the fit gave no models")?;
    progress("venting and taring");
    bench.run(Duration::from_secs(20));
    bench.tare()?;
    let taxels = plan.patches[0].patch.taxels().len();
    let mut weighings = Vec::new();
    for kilogram in MASSES_KG {
        progress(&format!("weighing {kilogram} kg"));
        for place in 0..PLACES {
            // Evenly spread, a few taxels on with each mass and seed, so that no place is special.
            let step = taxels / PLACES;
            let offset = (kilogram * 100.0) as usize + 7 * seed as usize;
            let centre = (place * step + offset) % taxels;
            weighings.push(bench.weigh(kilogram, TaxelIndex(centre as u16))?);
        }
    }
    Ok(Outcome { session, models, weighings })
}
