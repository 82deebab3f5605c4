//! A simulated forearm in its bag and under known masses, and the engine's own force on it.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use taxel_engine::RestStatistics;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::calibration::fit::FitRecipe;
use taxel_engine::force::{Force, ZeroState};
use taxel_engine::model_set::ModelSet;
use taxel_engine::plan::{Gauge, Outputs, PatchPlan};
use taxel_sim::{BoardsConfig, Config, Effect, GaugeConfig, LoadPath, Mass, PumpCommand, World};
use taxel_skin::{BusIndex, Geometry, Kilopascal, ModuleSite, TaxelIndex, Time, area};
use taxel_wire::TimedFrame;
use taxel_wire::icub::{Message, Pairer, decode};
use taxel_wire::signal::SignalSpec;

use crate::numbers::{mean, median};
use crate::recording::Recording;

/// The boards send so often.
const PERIOD: Duration = Duration::from_millis(50);

/// The simulator is stepped so.
const STEP: Duration = Duration::from_millis(5);

/// Rest is watched for so long, before and after a cycle, too.
const REST_S: f64 = 1.0;
const CYCLE_REST_S: f64 = 10.0;

/// After venting the fabric settles, and creep fades.
const SETTLE_S: f64 = 20.0;

/// A load settles for so long before it is read.
const LOAD_S: f64 = 1.0;

/// The masses of the paper's validation, kg, and on how many places each is laid.
const MASSES_KG: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
const PLACES: usize = 4;

/// A known mass, and the counts that were read before, under and after it.
pub(crate) struct Weighed {
    pub kilogram: f64,
    /// Its weight.
    pub true_n: f64,
    before: Vec<Scan>,
    scans: Vec<Scan>,
    after: Vec<Scan>,
}

/// One count of every taxel, and the mean of what the gauge said when each board sent its part.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    counts: Vec<u16>,
    gauge_kpa: f64,
}

/// A forearm on a simulated bus.
struct Forearm {
    world: World,
    gauge: SignalSpec,
    boards: Vec<Range<usize>>,
    /// Newest count of every taxel.
    counts: Vec<u16>,
    /// Newest pressure of the gauge.
    gauge_kpa: f64,
    /// By module.
    pairers: Vec<Pairer>,
    /// Pads sample what presses, as on a real skin.
    samples: bool,
}

impl Forearm {
    /// The forearm of a seed with these effects, streaming and at rest.
    ///
    /// # Errors
    /// A layout or configuration that cannot be, which the fixed ones are not.
    fn new(effects: &[Effect], seed: u64) -> anyhow::Result<Self> {
        let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
        let (skin, config) = Effect::forearm(effects, seed)?;
        let samples = config.loads != LoadPath::Shared;
        let world = World::new(skin, Config { boards, ..config });
        let patch = world.skin().patch();
        let mut boards = vec![0..0; patch.boards().len()];
        for (taxel, site) in patch.taxels().iter().enumerate() {
            let board = &mut boards[usize::from(patch.modules()[usize::from(site.module)].board)];
            *board = if board.start == board.end { taxel..taxel + 1 } else { board.start..taxel + 1 };
        }
        let counts = vec![0; patch.taxels().len()];
        let pairers = vec![Pairer::new(PERIOD / 2); patch.modules().len()];
        let gauge = GaugeConfig::default().signal;
        let mut forearm = Self { gauge, boards, counts, gauge_kpa: f64::NAN, pairers, samples, world };
        forearm.watch(1.0); // the first conversions are the boards' tare
        Ok(forearm)
    }

    /// What `taxeld` makes of a configuration that asks for everything and only listens.
    ///
    /// # Errors
    /// Geometry that cannot be read, which the simulator's own is not.
    fn plan(&self) -> anyhow::Result<PatchPlan> {
        let skin = self.world.skin();
        let patch = skin.patch().clone();
        Ok(PatchPlan {
            period: PERIOD,
            geometry: Some(Geometry::parse(&skin.positions_file(), &patch)?),
            areas: vec![skin.taxel_area(); patch.taxels().len()],
            area_uncertainty: 0.01,
            gauge: Some(Gauge::new(BusIndex(0), self.gauge)),
            outputs: Outputs { resultant: true, moment: true, contacts: true, fill: true, place: self.samples },
            ..PatchPlan::new(patch)
        })
    }

    /// Lets time pass and gives the scans of it.
    fn watch(&mut self, seconds: f64) -> Vec<Scan> {
        let end = self.world.now() + Duration::from_secs_f64(seconds);
        let mut parts: Vec<Vec<Scan>> = self.boards.iter().map(|_| Vec::new()).collect();
        let mut frames = Vec::new();
        while self.world.now() < end {
            self.world.advance(self.world.now() + STEP, &mut frames);
            for frame in frames.drain(..) {
                if frame.frame.id == self.gauge.id {
                    self.gauge_kpa = self.gauge.decode(&frame.frame).map_or(self.gauge_kpa, |kpa| kpa.0);
                } else if let Some(board) = self.take(&frame) {
                    let counts = self.counts[self.boards[board].clone()].to_vec();
                    parts[board].push(Scan { counts, gauge_kpa: self.gauge_kpa });
                }
            }
        }
        let scans = parts.iter().map(Vec::len).min().unwrap_or(0);
        let scan = |k: usize| Scan {
            counts: parts.iter().flat_map(|part| part[k].counts.iter().copied()).collect(),
            gauge_kpa: mean(parts.iter().map(|part| part[k].gauge_kpa)),
        };
        (0..scans).map(scan).collect()
    }

    /// Takes a board's frame; the board, if this was the last frame of its scan.
    fn take(&mut self, frame: &TimedFrame) -> Option<usize> {
        let patch = self.world.skin().patch();
        let module_of = |address, module| {
            let board = |site: &ModuleSite| patch.boards()[usize::from(site.board)].address;
            patch.modules().iter().position(|site| site.module == module && board(site) == address)
        };
        let (at, scan) = match decode(&frame.frame).ok()? {
            Message::Head { board, module, values } => {
                self.pairers[module_of(board, module)?].head(frame.time, values);
                return None;
            }
            Message::Tail { board, module, values, status } => {
                let at = module_of(board, module)?;
                (at, self.pairers[at].tail(frame.time, values, status)?)
            }
            _ => return None,
        };
        let site = patch.modules()[at];
        for (taxel, slot) in (usize::from(site.first_taxel)..).zip(site.kind.taxel_slots()) {
            self.counts[taxel] = scan.values[usize::from(*slot)].into();
        }
        let last = patch.boards()[usize::from(site.board)].modules.last()?.0;
        (site.module == last).then_some(usize::from(site.board))
    }

    /// What the taxels read now, at rest.
    fn rest(&mut self) -> Vec<TaxelBaseline> {
        let mut statistics = RestStatistics::new(self.counts.len());
        for scan in self.watch(REST_S) {
            statistics.push(scan.counts.iter().map(|count| Some(f64::from(*count))));
        }
        statistics.baseline()
    }

    /// From rest to about `target_kpa` and back to rest, every scan of it.
    fn cycle(&mut self, target_kpa: f64, kpa_per_s: f64) -> Vec<Scan> {
        let mut scans = self.watch(CYCLE_REST_S);
        for target in [target_kpa, 0.0] {
            self.world.pump(PumpCommand::Ramp { target: Kilopascal(target), kpa_per_s });
            scans.extend(self.watch(target_kpa / kpa_per_s + 2.0));
        }
        scans.extend(self.watch(CYCLE_REST_S));
        scans
    }

    /// Vents the bag and waits until the fabric has settled.
    fn vent(&mut self) {
        self.world.pump(PumpCommand::Vent);
        self.watch(SETTLE_S);
        self.world.pump(PumpCommand::Off);
    }

    /// All masses on discs of 600 mm2, each laid on, read and taken away, on all places. These are evenly spread and a few taxels
    /// on with each mass and `skin`, so that no place is special.
    ///
    /// # Errors
    /// A mass that cannot lie there, which all of them can.
    fn weigh_all(&mut self, skin: usize) -> anyhow::Result<Vec<Weighed>> {
        let (mut all, taxels) = (Vec::new(), self.counts.len());
        for (m, kilogram) in MASSES_KG.into_iter().enumerate() {
            for place in 0..PLACES {
                let taxel = (place * taxels / PLACES + 20 * m + 7 * skin) % taxels;
                let centre = TaxelIndex(u16::try_from(taxel).context("a taxel beyond 65,535")?);
                let true_n = self.world.lay(Mass::on_disc(kilogram, centre, 600.0))?.0;
                let (before, scans) = (self.watch(LOAD_S), self.watch(0.5));
                self.world.clear();
                all.push(Weighed { kilogram, true_n, before, scans, after: self.watch(2.0 * LOAD_S) });
            }
        }
        Ok(all)
    }
}

/// Scans as a recording.
fn recording(scans: &[Scan]) -> Recording {
    let taxels = scans.first().map_or(0, |scan| scan.counts.len());
    let column = |taxel: usize| scans.iter().map(|scan| f64::from(scan.counts[taxel])).collect();
    Recording {
        time_s: (0..scans.len()).map(|i| i as f64 * PERIOD.as_secs_f64()).collect(),
        lines: (2..).take(scans.len()).collect(),
        pressure_kpa: Some(scans.iter().map(|scan| scan.gauge_kpa).collect()),
        counts: (0..taxels).map(column).collect(),
        ..Recording::default()
    }
}

/// The simulated bag's highest pressure, and how fast it rises and falls.
pub(crate) const TARGET_KPA: f64 = 70.0;
const KPA_PER_S: f64 = 1.0;

/// A skin that was in the bag and then under masses.
pub(crate) struct Tried {
    pub calibration: Recording,
    pub weighings: Vec<Weighed>,
    /// With everything, and as the paper has it: equal areas, active taxels only.
    plans: [PatchPlan; 2],
    rest: Vec<TaxelBaseline>,
}

impl Tried {
    /// The forearm of a seed, after so many runs in the bag. The masses lie elsewhere with each `skin`.
    ///
    /// # Errors
    /// A simulation that cannot be set up, which it can.
    pub fn new(effects: &[Effect], seed: u64, runs: usize, skin: usize) -> anyhow::Result<Self> {
        let mut forearm = Forearm::new(effects, seed)?;
        let mut plan = forearm.plan()?;
        let equal = PatchPlan { geometry: None, outputs: Outputs::default(), ..plan.clone() };
        plan.areas = area::template(&plan.patch, plan.areas[0]);
        let mut scans = Vec::new();
        for _ in 0..runs {
            scans.extend(forearm.cycle(TARGET_KPA, KPA_PER_S));
            forearm.vent();
        }
        let rest = forearm.rest();
        let weighings = forearm.weigh_all(skin)?;
        Ok(Self { calibration: recording(&scans), weighings, plans: [plan, equal], rest })
    }

    /// The engine's own force of each weighing with the models of a recipe, N, and the median time of a scan, us.
    pub fn forces(&self, set: Arc<ModelSet>, recipe: &FitRecipe) -> (Vec<f64>, f64) {
        let plan = &self.plans[usize::from(recipe.is_paper())];
        let (mut live, mut times_us) = (Live::new(set, plan, &self.rest), Vec::new());
        let mut force = |weighed: &Weighed| {
            let mut read = |scans: &[Scan]| {
                let begun = std::time::Instant::now();
                let force = mean(scans.iter().map(|scan| live.read(&scan.counts)));
                times_us.push(1e6 * begun.elapsed().as_secs_f64() / scans.len().max(1) as f64);
                force
            };
            read(&weighed.before);
            let force = read(&weighed.scans);
            read(&weighed.after);
            force
        };
        let forces = self.weighings.iter().map(&mut force).collect();
        (forces, median(times_us))
    }

    /// The median time of a scan under the masses with these outputs, us.
    pub fn scan_us(&self, set: Arc<ModelSet>, outputs: Outputs) -> f64 {
        let plan = PatchPlan { outputs, ..self.plans[0].clone() };
        let mut live = Live::new(set, &plan, &self.rest);
        let time = |scan: &Scan| {
            let begun = std::time::Instant::now();
            std::hint::black_box(live.read(&scan.counts));
            1e6 * begun.elapsed().as_secs_f64()
        };
        median(self.weighings.iter().flat_map(|weighed| &weighed.scans).map(time))
    }
}

/// The engine's force on bare counts, scan after scan.
pub(crate) struct Live {
    force: Force,
    now: Time,
    period: Duration,
    sound: Vec<bool>,
    silent: Vec<bool>,
    pads: Vec<[u8; 2]>,
}

impl Live {
    /// With these models at the zero `rest`.
    #[must_use]
    pub fn new(set: Arc<ModelSet>, plan: &PatchPlan, rest: &[TaxelBaseline]) -> Self {
        let (taxels, modules) = (plan.areas.len(), plan.patch.modules().len());
        let mut force = Force::new(plan.force());
        force.set_models(set, 0.0);
        force.set_zero(Some(rest), 0.0);
        let (sound, silent, pads) = (vec![true; taxels], vec![false; modules], vec![[0; 2]; modules]);
        Self { force, now: Time::default(), period: plan.period, sound, silent, pads }
    }

    /// The force of the next scan, N; NaN if there is none. Hysteresis follows, where it is compensated.
    pub fn read(&mut self, counts: &[u16]) -> f64 {
        let scan = taxel_engine::Scan {
            time: self.now,
            whole: true,
            counts: counts.into(),
            pads: &self.pads,
            silent: &self.silent,
            sound: &self.sound,
            soundness: 0,
            jumps: &[],
        };
        self.now = self.now + self.period;
        self.force.follow(&scan);
        self.force.sample(&scan, 0, &ZeroState::default()).sample.total.map_or(f64::NAN, |total| total.0)
    }
}
