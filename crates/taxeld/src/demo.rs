//! `taxeld demo`: the whole procedure on a simulated forearm, and how far the force is off.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, bail};
use taxel_engine::calibration::{SessionState, SessionView};
use taxel_engine::command::Command;
use taxel_engine::plan::Plan;
use taxel_engine::snapshot::ForceState;
use taxel_sim::{Config, Effect, Footprint, Mass, Profile, PumpCommand, STANDARD_GRAVITY, Skin, World};
use taxel_skin::{BusIndex, Kilopascal, TaxelIndex, Time};

use crate::offline::Offline;

/// Step of the simulation: a bus delivers frames this often.
const STEP: Duration = Duration::from_millis(10);

/// The masses of the paper's validation, in kilogram.
pub const MASSES_KG: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];

/// The forces of fingers, in newton.
pub const FINGERS_N: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// The area that a mass lies on, in mm2: some 14 taxels with their gaps.
const FOOTPRINT_MM2: f64 = 600.0;

/// Radius of the area that a finger presses on, least and most, in mm.
const FINGER_MM: [f64; 2] = [4.5, 9.5];

/// A load lies on the skin with at least this share of its area.
const ON_SKIN_MIN: f64 = 0.98;

/// Places that each mass is laid on, spread over the forearm.
const PLACES: usize = 4;

/// A little beyond the range that is used live, so that its end is not a clamp.
const PUMP_TARGET: Kilopascal = Kilopascal(74.0);
const PUMP_KPA_PER_S: f64 = 1.0;

/// What a load is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// A mass on an ellipse, flat or round, maybe tilted.
    Mass,
    /// A finger on a disc.
    Finger,
}

/// One weighing.
pub struct Weighing {
    /// What lies there.
    pub contact: Contact,
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

/// Mean of some numbers; NaN of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}

/// A simulated forearm on a simulated bus, and the engine that listens to it.
struct Bench {
    world: World,
    offline: Offline,
}

impl Bench {
    fn new(plan: Arc<Plan>, seed: u64) -> anyhow::Result<Self> {
        let (skin, config) = skin(seed)?;
        let world = World::new(skin, config);
        let mut offline = Offline::new(plan);
        offline.advance(Time::default());
        Ok(Self { world, offline })
    }

    fn run(&mut self, span: Duration) {
        let (end, mut frames) = (self.world.now() + span, Vec::new());
        while self.world.now() < end {
            let now = self.world.now() + STEP;
            self.world.advance(now, &mut frames);
            self.offline.frames(BusIndex(0), &frames);
            self.offline.advance(now);
            frames.clear();
            for (_, frame) in self.offline.to_send.drain(..) {
                self.world.send(now, &frame);
            }
        }
    }

    fn run_until(&mut self, limit: Duration, what: &str, done: impl Fn(&Self) -> bool) -> anyhow::Result<()> {
        let end = self.world.now() + limit;
        while !done(self) {
            if self.world.now() >= end {
                let force = self.offline.snapshots.first().map(|snapshot| snapshot.force.why()).unwrap_or_default();
                bail!("{what} did not happen within {} s of simulated time: {force}", limit.as_secs());
            }
            self.run(STEP);
        }
        Ok(())
    }

    fn session(&self) -> anyhow::Result<Arc<SessionView>> {
        self.offline.session().cloned().context("there is no session")
    }

    fn in_state(&self, state: SessionState) -> bool {
        self.session().is_ok_and(|s| s.state == state)
    }

    /// Bag, ramp, fit: the calibration of the paper.
    fn calibrate(&mut self) -> anyhow::Result<String> {
        self.run_until(Duration::from_secs(5), "board bring-up", |b| {
            let boards = &b.offline.health.boards;
            !boards.is_empty() && boards.iter().all(|board| board.bring_up == "verified")
        })?;
        self.offline.start_session(None)?;
        self.run_until(Duration::from_secs(10), "the zero", |b| b.in_state(SessionState::Ramping))?;
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
        // Models are used on other days than that of their calibration.
        self.world.next_day();
        let (patch, model_set) = (String::new(), id.to_owned());
        self.offline.ask(Command::Activate { patch, model_set: model_set.clone(), expected: None })?;
        Ok(model_set)
    }

    fn tare(&mut self) -> anyhow::Result<()> {
        let mut done = self.offline.ask(Command::Tare { patch: String::new(), confirmed_by: None })?;
        while done.is_none() {
            self.run(STEP);
            done = self.offline.replied()?;
        }
        Ok(())
    }

    fn has_force(&self) -> bool {
        let sample = &self.offline.snapshots[0].force;
        sample.total.is_some() && matches!(sample.state, ForceState::Ok | ForceState::Degraded)
    }

    /// Lays a load down, lets it settle, and reads ten scans.
    fn weigh(&mut self, (contact, load): (Contact, Mass)) -> anyhow::Result<Weighing> {
        let force = self.world.lay(load)?;
        self.run(Duration::from_secs(1));
        let (mut measured_n, mut sigma_n) = (0.0, 0.0);
        for _ in 0..10 {
            self.run(Duration::from_millis(50));
            // A zero that is in check for a moment gives no force; a weighing waits for it as an operator would.
            self.run_until(Duration::from_secs(3), "a force", Self::has_force)?;
            let sample = &self.offline.snapshots[0].force;
            measured_n += sample.total.map_or(f64::NAN, |total| total.0) / 10.0;
            sigma_n += sample.total_sigma.map_or(f64::NAN, |s| s.0) / 10.0;
        }
        self.world.clear();
        self.run(Duration::from_secs(2));
        Ok(Weighing { contact, true_n: force.0, measured_n, sigma_n })
    }
}

/// The whole procedure on the skin of one seed.
pub fn procedure(plan: &Arc<Plan>, seed: u64) -> anyhow::Result<Outcome> {
    let mut bench = Bench::new(Arc::clone(plan), seed)?;
    let id = bench.calibrate()?;
    let session = SessionView::clone(&*bench.session()?);
    let models = bench.offline.model_sets.iter().find(|set| set.id == id).cloned().context("the fit gave no models")?;
    bench.run(Duration::from_secs(20));
    bench.tare()?;
    let mut places = Places { state: seed };
    let mut weighings = Vec::new();
    let masses = MASSES_KG.map(|kilogram| (Contact::Mass, kilogram * STANDARD_GRAVITY));
    for (contact, newton) in masses.into_iter().chain(FINGERS_N.map(|newton| (Contact::Finger, newton))) {
        for _ in 0..PLACES {
            let load = places.load(contact, newton, bench.world.skin())?;
            weighings.push(bench.weigh((contact, load))?);
        }
    }
    Ok(Outcome { session, models, weighings })
}

/// The demo's skin: all that makes a real one worse than an ideal one.
pub fn skin(seed: u64) -> anyhow::Result<(Skin, Config)> {
    Ok(Effect::forearm(&Effect::ALL, seed)?)
}

/// Draws where loads lie, the same for the same seed.
struct Places {
    state: u64,
}

impl Places {
    /// Uniform from `low` to `high` (SplitMix64; Steele, Lea and Flood 2014).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^= mixed >> 31;
        low + (high - low) * (mixed >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A load of so many newton anywhere on the skin, not only over a taxel's centre.
    fn load(&mut self, contact: Contact, newton: f64, skin: &Skin) -> anyhow::Result<Mass> {
        for _ in 0..1000 {
            let footprint = self.footprint(contact, skin.poses().len());
            if footprint.share_on_skin(skin)? >= ON_SKIN_MIN {
                return Ok(Mass { kilogram: newton / STANDARD_GRAVITY, footprint });
            }
        }
        bail!("no place on the simulated skin is wide enough for {newton} N");
    }

    fn footprint(&mut self, contact: Contact, taxels: usize) -> Footprint {
        let centre = TaxelIndex(self.between(0.0, taxels as f64) as u16);
        let offset_mm = [self.between(-4.0, 4.0), self.between(-4.0, 4.0)];
        let turn = self.between(0.0, std::f64::consts::PI);
        let disc = Footprint { offset_mm, turn, ..Footprint::disc(centre, FOOTPRINT_MM2) };
        match contact {
            Contact::Mass => {
                let (radius, stretch) = (disc.semi_axes_mm[0], self.between(1.0, 2.0).sqrt());
                let profile = if self.between(0.0, 1.0) < 0.5 { Profile::Flat } else { Profile::Hertz };
                let semi_axes_mm = [radius * stretch, radius / stretch];
                Footprint { semi_axes_mm, profile, tilt: self.between(0.0, 0.4), ..disc }
            }
            Contact::Finger => {
                let radius = self.between(FINGER_MM[0], FINGER_MM[1]);
                Footprint { semi_axes_mm: [radius; 2], ..disc }
            }
        }
    }
}
