//! The harness that all sections share: a simulated forearm in its bag, as scans with the gauge's pressure
//! and the true one beside them, and models of it with how far these are off ([`fits`]).

pub(crate) mod fits;
#[cfg(test)]
mod tests;

use std::ops::Range;
use std::time::Duration;

use anyhow::Context;
use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::plan::{Gauge, Outputs, PatchPlan};
use taxel_engine::zero::rest::RestStatistics;
use taxel_model::{FitOptions, GaugeUncertainty};
use taxel_sim::{BoardsConfig, Config, Effect, GaugeConfig, Mass, PumpCommand, World};
use taxel_skin::{BusIndex, Geometry, Kilopascal, TaxelIndex, Time};
use taxel_wire::TimedFrame;
use taxel_wire::icub::{Message, Pairer, decode};
use taxel_wire::signal::SignalSpec;

/// The boards send so often.
pub(crate) const PERIOD: Duration = Duration::from_millis(50);

/// The grid on which the truth is noted: that of the bag's own steps.
const STEP: Duration = Duration::from_millis(5);

/// Rest is watched for so long.
const REST_S: f64 = 1.0;

/// The same before and after a recording of both branches.
const CYCLE_REST_S: f64 = 10.0;

/// After venting the fabric settles, and creep fades.
const SETTLE_S: f64 = 20.0;

/// A load settles for so long before it is read.
const LOAD_S: f64 = 1.0;

/// What the gauge's data sheet would say.
const GAUGE: GaugeUncertainty = GaugeUncertainty { gain_rel: 0.0025, offset_kpa: 0.05, noise_kpa: 0.02 };

/// The masses of the paper's validation, kg, and the places that each is laid on.
pub(crate) const MASSES_KG: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
pub(crate) const PLACES: usize = 4;

/// A known mass, and what was read under it.
pub(crate) struct Weighed {
    pub kilogram: f64,
    /// Its weight.
    pub true_n: f64,
    /// While it settled.
    pub before: Vec<Scan>,
    /// While it was read: ten of them.
    pub scans: Vec<Scan>,
    /// After it was taken away.
    pub after: Vec<Scan>,
}

/// One count of every taxel, and the pressure in the bag when each board sent its part.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    /// By taxel.
    pub counts: Vec<u8>,
    /// What the gauge said, kPa, by taxel's board: see [`Forearm::board_of`].
    pub gauge_kpa: Vec<f64>,
    /// What it was, kPa, likewise.
    pub true_kpa: Vec<f64>,
}

/// A quantity over time.
#[derive(Debug, Default)]
struct Course(Vec<(Time, f64)>);

impl Course {
    /// Linear between its points, constant beyond them; NaN without any.
    fn at(&self, time: Time) -> f64 {
        let after = self.0.partition_point(|(t, _)| *t < time);
        match (after.checked_sub(1).and_then(|before| self.0.get(before)), self.0.get(after)) {
            (Some((t0, v0)), Some((t1, v1))) => v0 + (v1 - v0) * time.seconds_since(*t0) / t1.seconds_since(*t0),
            (Some((_, v)), None) | (None, Some((_, v))) => *v,
            (None, None) => f64::NAN,
        }
    }
}

/// One board's part of a scan.
struct BoardScan {
    time: Time,
    counts: Vec<u8>,
}

/// A forearm on a simulated bus.
#[derive(Clone, Debug)]
pub(crate) struct Forearm {
    world: World,
    gauge: SignalSpec,
    boards: Vec<Range<usize>>,
    /// Newest count of every taxel.
    counts: Vec<u8>,
    /// By module.
    pairers: Vec<Pairer>,
}

impl Forearm {
    /// The forearm of a seed, streaming and at rest, without what [`Effect`] lists.
    ///
    /// # Errors
    /// A layout or configuration that cannot be, which the fixed ones are not.
    pub fn new(seed: u64) -> anyhow::Result<Self> {
        Self::with(&[], seed)
    }

    /// The same with these effects.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(effects: &[Effect], seed: u64) -> anyhow::Result<Self> {
        let boards = BoardsConfig { start_streaming: true, ..BoardsConfig::default() };
        let (skin, config) = Effect::forearm(effects, seed)?;
        let world = World::new(skin, Config { boards, ..config })?;
        let patch = world.skin().patch();
        let mut boards = vec![0..0; patch.boards().len()];
        for (taxel, site) in patch.taxels().iter().enumerate() {
            let board = &mut boards[usize::from(patch.modules()[usize::from(site.module)].board)];
            *board = if board.start == board.end { taxel..taxel + 1 } else { board.start..taxel + 1 };
        }
        let counts = vec![0; patch.taxels().len()];
        let pairers = vec![Pairer::new(PERIOD / 2); patch.modules().len()];
        let mut forearm = Self { gauge: GaugeConfig::default().signal, boards, counts, pairers, world };
        forearm.watch(1.0); // the first conversions are the boards' tare
        Ok(forearm)
    }

    /// What `taxeld` makes of a scene that asks for everything and only listens.
    ///
    /// # Errors
    /// Geometry that cannot be read, which the simulator's own is not.
    pub fn plan(&self) -> anyhow::Result<PatchPlan> {
        let skin = self.world.skin();
        let patch = skin.patch().clone();
        Ok(PatchPlan {
            period: PERIOD,
            geometry: Some(Geometry::parse(&skin.positions_file(), &patch)?),
            areas: vec![skin.taxel_area(); patch.taxels().len()],
            area_uncertainty: 0.01,
            gauge: Some(Gauge { bus: BusIndex(0), signal: self.gauge }),
            outputs: Outputs { resultant: true, moment: true, contacts: true, fill: true },
            fit: FitOptions { gauge: GAUGE, ..FitOptions::default() },
            ..PatchPlan::new(patch)
        })
    }

    /// Which part of a scan's pressures belongs to a taxel.
    #[must_use]
    pub fn board_of(&self, taxel: usize) -> usize {
        self.boards.iter().position(|board| board.contains(&taxel)).unwrap_or(0)
    }

    /// Number of taxels.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.counts.len()
    }

    /// The simulator's present.
    pub fn now(&self) -> Time {
        self.world.now()
    }

    /// Lets time pass and gives the scans of it.
    pub fn watch(&mut self, seconds: f64) -> Vec<Scan> {
        let end = self.now() + Duration::from_secs_f64(seconds);
        let (mut gauge, mut truth) = (Course::default(), Course::default());
        let mut parts: Vec<Vec<BoardScan>> = self.boards.iter().map(|_| Vec::new()).collect();
        let mut frames = Vec::new();
        while self.now() < end {
            self.world.advance(self.now() + STEP, &mut frames);
            truth.0.push((self.now(), self.world.true_pressure().0));
            for frame in frames.drain(..) {
                if frame.frame.id == self.gauge.id {
                    gauge.0.extend(self.gauge.decode(&frame.frame).ok().map(|kpa| (frame.time, kpa.0)));
                } else if let Some(board) = self.take(&frame) {
                    let counts = self.counts[self.boards[board].clone()].to_vec();
                    parts[board].push(BoardScan { time: frame.time, counts });
                }
            }
        }
        let scans = parts.iter().map(Vec::len).min().unwrap_or(0);
        let scan = |k: usize| Scan {
            counts: parts.iter().flat_map(|part| part[k].counts.iter().copied()).collect(),
            gauge_kpa: parts.iter().map(|part| gauge.at(part[k].time)).collect(),
            true_kpa: parts.iter().map(|part| truth.at(part[k].time)).collect(),
        };
        (0..scans).map(scan).collect()
    }

    /// Takes a board's frame; the board, if this was the last frame of its scan.
    fn take(&mut self, frame: &TimedFrame) -> Option<usize> {
        let patch = self.world.skin().patch();
        let module_of = |address, module| {
            let of = |site: &taxel_skin::ModuleSite| {
                patch.boards()[usize::from(site.board)].address == address && site.module == module
            };
            patch.modules().iter().position(of)
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
            self.counts[taxel] = scan.values[usize::from(*slot)];
        }
        let last = patch.boards()[usize::from(site.board)].modules.last()?.0;
        (site.module == last).then_some(usize::from(site.board))
    }

    /// What the taxels read now, at rest.
    pub fn rest(&mut self) -> Vec<TaxelBaseline> {
        let mut statistics = RestStatistics::new(self.taxels());
        for scan in self.watch(REST_S) {
            statistics.push(scan.counts.iter().map(|count| Some(f64::from(*count))));
        }
        statistics.baseline()
    }

    /// A ramp from rest to `target_kpa`, as far as the gauge rises.
    pub fn ramp(&mut self, target_kpa: f64, kpa_per_s: f64) -> Vec<Scan> {
        // A little further, so that the pump does not slow down where the ramp is still used.
        self.world.pump(PumpCommand::Ramp { target: Kilopascal(target_kpa + 2.0), kpa_per_s });
        let mut scans = self.watch((target_kpa + 2.0) / kpa_per_s + 2.0);
        let reached = |scan: &Scan| scan.gauge_kpa.iter().any(|kpa| *kpa >= target_kpa);
        scans.truncate(scans.iter().position(reached).unwrap_or(scans.len()));
        scans
    }

    /// Lets the pressure back down from about `from_kpa` at this rate, and rests for a moment.
    pub fn release(&mut self, from_kpa: f64, kpa_per_s: f64) -> Vec<Scan> {
        self.world.pump(PumpCommand::Ramp { target: Kilopascal(0.0), kpa_per_s });
        self.watch((from_kpa + 2.0) / kpa_per_s + 2.0)
    }

    /// From rest to about `target_kpa` and back to rest, every scan of it.
    pub fn cycle(&mut self, target_kpa: f64, kpa_per_s: f64) -> Vec<Scan> {
        let mut scans = self.watch(CYCLE_REST_S);
        self.world.pump(PumpCommand::Ramp { target: Kilopascal(target_kpa), kpa_per_s });
        scans.extend(self.watch(target_kpa / kpa_per_s + 2.0));
        scans.extend(self.release(target_kpa, kpa_per_s));
        scans.extend(self.watch(CYCLE_REST_S));
        scans
    }

    /// Vents the bag and waits until the fabric has settled.
    pub fn vent(&mut self) {
        self.world.pump(PumpCommand::Vent);
        self.watch(SETTLE_S);
        self.world.pump(PumpCommand::Off);
    }

    /// Lays a mass about a taxel on 600 mm2, a disc of 28 mm, lets it settle, reads it, takes it away and waits.
    ///
    /// # Errors
    /// A mass that cannot lie there.
    pub fn weigh(&mut self, kilogram: f64, taxel: usize) -> anyhow::Result<Weighed> {
        let centre = TaxelIndex(u16::try_from(taxel).context("a taxel beyond 65,535")?);
        let true_n = self.world.lay(Mass::on_disc(kilogram, centre, 600.0))?.0;
        let (before, scans) = (self.watch(LOAD_S), self.watch(0.5));
        self.world.clear();
        Ok(Weighed { kilogram, true_n, before, scans, after: self.watch(2.0 * LOAD_S) })
    }

    /// All masses on all places, which are evenly spread and a few taxels on with each mass and `skin`, so that no place
    /// is special.
    ///
    /// # Errors
    /// A mass that cannot lie there, which all of them can.
    pub fn weigh_all(&mut self, skin: usize) -> anyhow::Result<Vec<Weighed>> {
        let mut all = Vec::new();
        for (m, kilogram) in MASSES_KG.into_iter().enumerate() {
            for place in 0..PLACES {
                let centre = (place * self.taxels() / PLACES + 20 * m + 7 * skin) % self.taxels();
                all.push(self.weigh(kilogram, centre)?);
            }
        }
        Ok(all)
    }
}
