//! Section `fit`: what precision of a fit costs what time, for ours and for what else one could take.
//!
//! Every method is compared with the exact solution of its own least-squares problem, so that the error here is that of
//! arithmetic alone; how well a model predicts pressures is section `force`.
//!
//! The recordings are simulated: C = C0 - g P / (P + Ph) + noise, with C0 = 240 +- 6, g = 40 to 180 and Ph = 15 to 65 kPa
//! per taxel, noise of 0.7 counts; P rises evenly from 0 to 70 kPa with noise of 0.05 kPa. Pressures are whole multiples of
//! 2^-10 kPa, about what a gauge resolves: so they are exact as f64 and as [`FixedPressure`] alike.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use taxel_model::reference::{QuickReference, Reference};
use taxel_model::{
    Accumulator, Dd, Estimator, FitOptions, FixedPressure, MIN_BINNED_SAMPLES, Order, Shape, TaxelModel,
};

use super::args::ReportArgs;
use crate::document::{Aim, Axis, Figure, Level, Line, Section, Table, row};
use crate::numbers::{median, three_digits};
use crate::peers::{PEERS, Peer, Polynomial, RAW_SVD, Samples};

/// Units of pressure in a kPa.
const UNITS_PER_KPA: f64 = 1024.0;

const TOP_KPA: f64 = 70.0;

/// Two bins of the accumulator's own, whose width is 2^18 units of 2^-10 Pa.
const BIN_WIDTH_KPA: f64 = 0.512;

/// Orders 1 to this are swept; order 5 is the shipped one.
const ORDER_MAX: usize = 9;
const ORDER: usize = 5;

/// How many times smaller an error than an SVD on raw powers has at the highest order at least.
const WANTED_PRECISION: f64 = 1e6;

/// A whole skin, whose time is told beside the figures.
const SKIN: (usize, usize) = (6000, 230);

/// One ramp.
struct Ramp {
    /// Pressure of each scan, in units of 2^-10 kPa.
    units: Vec<i64>,
    kpa: Vec<f64>,
    fixed: Vec<Option<FixedPressure>>,
    /// Counts by taxel.
    taxels: Vec<Vec<u8>>,
}

/// Who competes.
#[derive(Clone, Copy)]
enum Contender {
    Ours(&'static str, Estimator),
    Other(Peer),
}

/// A curve as its method serves it.
enum Curve {
    Model(Box<TaxelModel>),
    Polynomial(Polynomial),
}

/// One contender at one order.
#[derive(Clone, Default)]
struct Cell {
    us: Vec<f64>,
    /// Worst error over all taxels and all their counts, Pa; infinite if the method failed on one.
    worst_pa: f64,
}

/// All contenders at all orders on ramps of one length: `cells[contender][order - 1]`.
struct Panel {
    scans: usize,
    cells: Vec<Vec<Cell>>,
    /// Half a count in Pa, median over the taxels.
    half_count_pa: f64,
}

/// In the same order everywhere, so that each looks the same in every diagram.
fn contenders() -> Vec<Contender> {
    let ours = [
        Contender::Ours("ours, per sample", Estimator::PerSample),
        Contender::Ours("ours, pressure-binned (shipped default)", Estimator::PressureBinned),
    ];
    ours.into_iter().chain(PEERS.map(Contender::Other)).collect()
}

/// Measures the section.
///
/// # Errors
/// None.
#[allow(clippy::unnecessary_wraps)] // as all sections
pub(super) fn section(args: &ReportArgs) -> anyhow::Result<Section> {
    let (sizes, taxels, rounds) =
        if args.quick { ([100, 10_000].as_slice(), 5, 10) } else { ([100, 10_000, 100_000].as_slice(), 20, 30) };
    let panels: Vec<Panel> = sizes.iter().map(|scans| Panel::measure(*scans, taxels, rounds, args.seed)).collect();
    let text = vec![
        "How long does a fit take, and how far is it from the exact solution? Each method goes from the samples of a taxel \
         to its curve and is compared with the exact solution, in integers without limit, of its own least-squares \
         problem: all samples, or means in bins of pressure (the shipped default). All methods have one thread and take \
         turns. The others are nalgebra's; numpy.polyfit is compared by tests/fit_time.py."
            .to_owned(),
        "What the time of ours buys: the same bits in whatever order the samples come, a verdict on the taxel, the \
         uncertainty of each reading, and a curve that is exact on skins that are stiff, noisy or clipped (section \
         Stability), where others have none. Who needs none of these, and has a sound taxel at order 5 or less, is well \
         served by Chebyshev polynomials."
            .to_owned(),
    ];
    Ok(Section {
        text,
        aims: aims(&panels, args.seed),
        figures: panels.iter().map(Panel::figure).collect(),
        tables: vec![table(&panels)],
        ..Section::default()
    })
}

fn aims(panels: &[Panel], seed: u64) -> Vec<Aim> {
    let worst = |wanted: &str| {
        let at = contenders().iter().position(|contender| contender.name() == wanted).unwrap_or(0);
        panels
            .iter()
            .filter(|panel| panel.scans == 10_000)
            .map(|panel| panel.cells[at][ORDER_MAX - 1].worst_pa)
            .fold(0.0, f64::max)
    };
    let (ours_pa, svd_pa) = (worst("ours, per sample"), worst(RAW_SVD));
    let ramp = Ramp::simulate(SKIN.0, SKIN.1, seed);
    let times_ms: Vec<f64> = (0..5)
        .map(|_| {
            let begun = Instant::now();
            (0..SKIN.1).for_each(|taxel| drop(black_box(ramp.sums(taxel).fit(&FitOptions::default()))));
            1e3 * begun.elapsed().as_secs_f64()
        })
        .collect();
    let what = "fit at order 9: times nearer to the exact solution than an SVD on powers of the raw count";
    vec![
        Aim::beside("sums and fit of 230 taxels, 6,000 scans each, order 5, ms", median(&times_ms)),
        Aim::beside("ours at order 9, largest distance from the exact solution, Pa", ours_pa),
        Aim::at_least(what, svd_pa / ours_pa.max(f64::MIN_POSITIVE), WANTED_PRECISION),
    ]
}

impl Ramp {
    fn simulate(scans: usize, taxels: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth: Vec<f64> = (0..scans).map(|k| TOP_KPA * k as f64 / scans as f64).collect();
        let noisy = |kpa: &f64| ((kpa + 0.05 * normal(&mut random)) * UNITS_PER_KPA).round() as i64;
        let units: Vec<i64> = truth.iter().map(noisy).collect();
        let kpa: Vec<f64> = units.iter().map(|units| *units as f64 / UNITS_PER_KPA).collect();
        let mut taxel = |_| {
            // Short of the rails, which are another story: section `stability`.
            let rest = (240.0 + 5.9 * normal(&mut random)).min(248.0);
            let (gain, half_kpa) = (random.random_range(40.0..180.0), random.random_range(15.0..65.0));
            let count = |kpa: &f64| rest - gain * kpa / (kpa + half_kpa) + 0.7 * normal(&mut random);
            truth.iter().map(count).map(|count| count.round().clamp(1.0, 254.0) as u8).collect()
        };
        let taxels = (0..taxels).map(&mut taxel).collect();
        Self { fixed: kpa.iter().map(|kpa| FixedPressure::from_kpa(*kpa)).collect(), units, kpa, taxels }
    }

    fn sums(&self, taxel: usize) -> Accumulator {
        let mut sums = Accumulator::new();
        sums.extend(self.taxels[taxel].iter().copied().zip(self.fixed.iter().copied()), 0);
        sums
    }

    /// The counts that occurred, ascending.
    fn codes(&self, taxel: usize) -> Vec<f64> {
        let mut codes = self.taxels[taxel].clone();
        codes.sort_unstable();
        codes.dedup();
        codes.into_iter().map(f64::from).collect()
    }

    /// The exact solutions of orders 0 to the highest of an estimator's problem: one row a count, or one a bin of pressure
    /// with mean count and mean pressure, weighted with the number of samples.
    fn exact(&self, taxel: usize, estimator: Estimator) -> Vec<QuickReference> {
        let mut rows: BTreeMap<i64, (i64, i64, i64)> = BTreeMap::new();
        for (units, count) in self.units.iter().zip(&self.taxels[taxel]) {
            let count = i64::from(*count);
            // 1 unit is 1000 times 2^-10 Pa.
            let key = if estimator == Estimator::PressureBinned { (units * 1000) >> 19 } else { count };
            let row = rows.entry(key).or_default();
            *row = (row.0 + 1, row.1 + count, row.2 + units);
        }
        let rows: Vec<_> = rows.into_values().collect();
        Reference::of_sums(&rows, -10, ORDER_MAX).iter().map(Reference::quick).collect()
    }
}

/// A normal number, by Box and Muller's method.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * random.random_range(f64::MIN_POSITIVE..1.0).ln()).sqrt();
    radius * (TAU * random.random_range(0.0..1.0)).cos()
}

impl Contender {
    fn name(&self) -> &'static str {
        match self {
            Self::Ours(name, _) => name,
            Self::Other(peer) => peer.name,
        }
    }

    fn estimator(&self) -> Estimator {
        if let Self::Ours(_, estimator) = self { *estimator } else { Estimator::PerSample }
    }

    /// Too few scans are never binned.
    fn takes_part(&self, scans: usize) -> bool {
        self.estimator() != Estimator::PressureBinned || scans as u64 >= MIN_BINNED_SAMPLES
    }

    /// Fits one taxel; the time is that from samples to curve, us.
    fn fit(&self, ramp: &Ramp, taxel: usize, order: usize) -> (f64, Option<Curve>) {
        let x: Vec<f64> = ramp.taxels[taxel].iter().copied().map(f64::from).collect();
        let begun = Instant::now();
        let curve = match self {
            Self::Other(peer) => {
                let samples = Samples { x: &x, y: &ramp.kpa, w: None };
                peer.fit(black_box(&samples), order).map(Curve::Polynomial)
            }
            // The plain least-squares curve on all counts: to repair a curve, or to leave out rare counts, is another problem.
            Self::Ours(_, estimator) => {
                let model = black_box(ramp).sums(taxel).fit(&FitOptions {
                    order: Order::Fixed(order as u8),
                    estimator: *estimator,
                    bin_width_kpa: Some(BIN_WIDTH_KPA),
                    min_samples_at_ends: 1,
                    shape: Shape::Report,
                    ..FitOptions::default()
                });
                model.curve.is_some().then(|| Curve::Model(Box::new(model)))
            }
        };
        (1e6 * begun.elapsed().as_secs_f64(), black_box(curve))
    }
}

impl Curve {
    /// Greatest distance from the exact solution over all observed counts, Pa; infinite where it is not finite. Ours never
    /// leaves the calibrated range, which for bins ends at their mean counts.
    fn error_pa(&self, exact: &QuickReference, codes: &[f64]) -> f64 {
        let error = |code: &f64| {
            let (count, kpa) = match self {
                Self::Model(model) => {
                    let count = model.range.map_or(*code, |[low, high]| code.max(low).min(high));
                    (count, model.evaluate(count).map_or(f64::NAN, |reading| reading.kpa))
                }
                Self::Polynomial(polynomial) => (*code, polynomial.evaluate(*code)),
            };
            1e3 * (Dd::from(kpa) - exact.evaluate(count)).hi.abs()
        };
        codes.iter().map(error).map(|pa| if pa.is_finite() { pa } else { f64::INFINITY }).fold(0.0, f64::max)
    }
}

impl Panel {
    /// Fits every taxel with every contender at every order, all taking turns.
    fn measure(scans: usize, taxels: usize, rounds: usize, seed: u64) -> Self {
        let (ramp, contenders) = (Ramp::simulate(scans, taxels, seed), contenders());
        let exact = |taxel| [Estimator::PerSample, Estimator::PressureBinned].map(|of| ramp.exact(taxel, of));
        let exact: Vec<[Vec<QuickReference>; 2]> = (0..taxels).map(exact).collect();
        let mut cells = vec![vec![Cell::default(); ORDER_MAX]; contenders.len()];
        for round in 0..rounds.max(taxels) {
            let (taxel, codes) = (round % taxels, ramp.codes(round % taxels));
            for order in 1..=ORDER_MAX {
                for (contender, cells) in contenders.iter().zip(&mut cells).filter(|(who, _)| who.takes_part(scans)) {
                    // Once to warm up, so that nobody pays for what the one before left in the caches.
                    contender.fit(&ramp, taxel, order);
                    let (us, curve) = contender.fit(&ramp, taxel, order);
                    let cell = &mut cells[order - 1];
                    cell.us.push(us);
                    let exact = &exact[taxel][usize::from(contender.estimator() == Estimator::PressureBinned)][order];
                    let error_pa = curve.map_or(f64::INFINITY, |curve| curve.error_pa(exact, &codes));
                    cell.worst_pa = cell.worst_pa.max(error_pa);
                }
            }
        }
        let swing = |taxel: usize| ramp.codes(taxel).last().zip(ramp.codes(taxel).first()).map_or(1.0, |(a, b)| a - b);
        let half_counts: Vec<f64> = (0..taxels).map(|taxel| 0.5e3 * TOP_KPA / swing(taxel)).collect();
        Self { scans, cells, half_count_pa: median(&half_counts) }
    }

    fn measured(&self) -> impl Iterator<Item = (Contender, &Vec<Cell>)> {
        contenders().into_iter().zip(&self.cells).filter(|(contender, _)| contender.takes_part(self.scans))
    }

    fn figure(&self) -> Figure {
        let line = |(contender, cells): (Contender, &Vec<Cell>)| Line {
            name: contender.name().to_owned(),
            ours: matches!(contender, Contender::Ours(..)),
            points: cells.iter().map(|cell| (median(&cell.us), cell.worst_pa)).collect(),
            ..Line::default()
        };
        Figure {
            id: format!("fit-{}", self.scans),
            title: format!("Fit: time per taxel against error, {} scans", self.scans),
            caption: format!(
                "Median time from samples to curve against the worst error over all taxels and their counts. A line goes \
                 through the orders 1 to {ORDER_MAX}. Lower left is better; what lies below a dashed level is more precise \
                 than that."
            ),
            x: Axis::log("time per taxel, us"),
            y: Axis::log("largest distance from the exact solution, Pa"),
            lines: self.measured().map(line).collect(),
            bands: vec![
                Level::new(self.half_count_pa, format!("half a count: {} Pa", three_digits(self.half_count_pa))),
                Level::new(2.5 * TOP_KPA, "0.25 % of 70 kPa, a good gauge: 175 Pa"),
            ],
            ..Figure::default()
        }
    }
}

/// Times and errors at the shipped order and at the highest.
fn table(panels: &[Panel]) -> Table {
    let mut rows = Vec::new();
    for panel in panels {
        for (contender, cells) in panel.measured() {
            let mut row = row![panel.scans as f64, contender.name()];
            for cell in [ORDER, ORDER_MAX].map(|order| &cells[order - 1]) {
                row.extend(row![median(&cell.us), cell.worst_pa]);
            }
            let useless = cells.iter().position(|cell| cell.worst_pa > panel.half_count_pa);
            row.extend(row![useless.map_or_else(|| "never".to_owned(), |at| (at + 1).to_string())]);
            rows.push(row);
        }
    }
    let columns = [
        "scans",
        "method",
        "order 5, us",
        "order 5, Pa",
        "order 9, us",
        "order 9, Pa",
        "off by half a count from order",
    ];
    let caption = "Median time per taxel and worst error at orders 5 and 9; `inf` where a taxel got no curve.";
    Table::new("fit-orders", caption, columns, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Also proves that both sides make the same bins: other bins would be off by pascals.
    #[test]
    fn ours_solves_the_very_problem_that_the_exact_side_solves_and_raw_powers_do_not() {
        let panel = Panel::measure(700, 2, 2, 3);
        for (contender, cells) in panel.measured() {
            for cell in cells.iter().filter(|_| matches!(contender, Contender::Ours(..))) {
                assert!(cell.worst_pa < 1e-9, "{}: {} Pa", contender.name(), cell.worst_pa);
                assert_eq!(cell.us.len(), 2);
            }
            let useless = cells.iter().any(|cell| cell.worst_pa > panel.half_count_pa);
            assert!(useless || contender.name() != "raw powers by normal equations");
        }
    }

    #[test]
    fn too_few_scans_for_bins_have_no_line() {
        assert_eq!(Panel::measure(100, 1, 1, 1).figure().lines.len(), contenders().len() - 1);
    }
}
