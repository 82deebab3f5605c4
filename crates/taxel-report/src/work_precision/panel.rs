//! One diagram: all contenders at all orders on one recording.

use taxel_model::reference::{QuickReference, Reference};
use taxel_model::stability::case::greatest;
use taxel_model::{Dd, Estimator};

use super::contenders::{Contender, Curve, contenders, solve};
use super::taxels::{Bits, Recording};
use crate::document::{Axis, Figure, Level, Line, Point};
use crate::numbers::{median, quantile, three_digits};
use crate::peers::{Fitted, Peers};

/// The knob's end: orders 1 to this are swept.
pub(super) const MAX_ORDER: usize = 9;

/// Pressure at the top of the calibration, Pa.
const TOP_PA: f64 = 70_000.0;

/// Distance of neighbouring f64 at 70 kPa, which is 2^-46 kPa, in Pa.
const STEP_PA: f64 = 1000.0 / (1_u64 << 46) as f64;

/// A good gauge's accuracy, of its full scale.
const GAUGE_ACCURACY: f64 = 0.0025;

/// What is measured in one diagram.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel {
    pub bits: Bits,
    pub scans: usize,
    pub taxels: usize,
    pub repetitions: usize,
}

/// One contender at one order.
#[derive(Clone, Debug, Default)]
pub(super) struct Cell {
    /// Times of all repetitions, us.
    us: Vec<f64>,
    /// Worst error over all taxels fitted and all their counts, Pa.
    worst_pa: f64,
    /// Taxels without a curve.
    failed: usize,
}

/// A diagram's measurements: `cells[contender][order - 1]`.
pub(super) struct Measured {
    pub panel: Panel,
    pub contenders: Vec<Contender>,
    pub cells: Vec<Vec<Cell>>,
    /// Half a count in Pa, median over taxels.
    half_count_pa: f64,
}

impl Cell {
    pub fn median_us(&self) -> f64 {
        median(&self.us)
    }

    /// Worst error, Pa; infinite if the method failed on any taxel.
    pub fn error_pa(&self) -> f64 {
        if self.failed > 0 { f64::INFINITY } else { self.worst_pa }
    }

    pub fn failed(&self) -> usize {
        self.failed
    }

    /// Whether the contender took part.
    pub fn is_measured(&self) -> bool {
        !self.us.is_empty()
    }
}

/// Exact pressures of one taxel: both problems, all orders from 0.
pub(super) struct Judge<'a> {
    /// All observed counts.
    codes: &'a [f64],
    per_sample: Vec<QuickReference>,
    binned: Vec<QuickReference>,
    /// `per_sample` at all observed counts, by order: most contenders are judged there.
    at_codes: Vec<Vec<Dd>>,
}

impl<'a> Judge<'a> {
    pub fn new(recording: &'a Recording, taxel: usize) -> Self {
        let solved = |estimator| -> Vec<QuickReference> {
            solve(estimator, recording, taxel, MAX_ORDER).iter().map(Reference::quick).collect()
        };
        let (per_sample, codes) = (solved(Estimator::PerSample), recording.taxels[taxel].codes.as_slice());
        let at_codes = per_sample.iter().map(|solution| codes.iter().map(|c| solution.evaluate(*c)).collect());
        Self { codes, at_codes: at_codes.collect(), per_sample, binned: solved(Estimator::PressureBinned) }
    }

    /// Greatest distance from the exact solution over all observed counts, Pa; `None` without a curve or a solution, or
    /// where it is not finite.
    pub fn error_pa(&self, fitted: &Fitted<Curve>, estimator: Estimator, order: usize) -> Option<f64> {
        let curve = fitted.curve.as_ref()?;
        let (solution, known) = match estimator {
            Estimator::PressureBinned => (self.binned.get(order)?, [].as_slice()),
            _ => (self.per_sample.get(order)?, self.at_codes.get(order)?.as_slice()),
        };
        let errors_pa = self.codes.iter().enumerate().map(|(k, code)| {
            let (count, kpa) = curve.evaluate(*code);
            let exact = known.get(k).copied().filter(|_| count == *code).unwrap_or_else(|| solution.evaluate(count));
            1000.0 * (Dd::from(kpa) - exact).hi.abs()
        });
        Some(greatest(errors_pa)).filter(|worst| worst.is_finite())
    }
}

impl Panel {
    pub fn name(&self) -> String {
        format!("{} bit, {} scans", self.bits.number(), self.scans)
    }

    /// Fits every taxel of a simulated recording with every contender at every order, all taking turns.
    pub fn measure(self, seed: u64, peers: &mut Peers) -> anyhow::Result<Measured> {
        let recording = Recording::simulate(self.bits, self.scans, self.taxels, seed);
        let judges: Vec<Judge> = (0..self.taxels).map(|taxel| Judge::new(&recording, taxel)).collect();
        let contenders = contenders(peers);
        let mut cells = vec![vec![Cell::default(); MAX_ORDER]; contenders.len()];
        for round in 0..self.repetitions.max(self.taxels) {
            let taxel = round % self.taxels;
            for order in 1..=MAX_ORDER {
                for turn in 0..contenders.len() {
                    // Another one begins in each round, so that no one always follows the same one.
                    let at = (turn + round) % contenders.len();
                    let contender = &contenders[at];
                    if self.scans < contender.least_scans() {
                        continue;
                    }
                    // Once to warm up, so that nobody pays for what the one before left in the caches.
                    contender.fit(&recording, taxel, order, peers)?;
                    let fitted = contender.fit(&recording, taxel, order, peers)?;
                    let cell = &mut cells[at][order - 1];
                    cell.us.push(fitted.us);
                    if round < self.taxels {
                        match judges[taxel].error_pa(&fitted, contender.estimator, order) {
                            Some(error_pa) => cell.worst_pa = cell.worst_pa.max(error_pa),
                            None => cell.failed += 1,
                        }
                    }
                }
            }
        }
        let half_counts: Vec<f64> = recording.taxels.iter().map(|taxel| 0.5 * TOP_PA / taxel.swing()).collect();
        Ok(Measured { panel: self, contenders, cells, half_count_pa: median(&half_counts) })
    }
}

impl Measured {
    pub fn figure(&self) -> Figure {
        let Panel { bits, scans, taxels, repetitions } = self.panel;
        Figure {
            id: format!("fit-{}bit-{scans}", bits.number()),
            title: format!("Fit: time per taxel against error, {}", self.panel.name()),
            caption: format!(
                "Time from samples to curve against the worst error over {taxels} taxels and all their observed counts, for \
                 orders 1 to {MAX_ORDER}; 1, 5 and {MAX_ORDER} are marked. Medians of {} fits, bars from 5 to 95 %. Lower \
                 left is better; what lies below a dotted level is more precise than that.",
                repetitions.max(taxels),
            ),
            x: Axis::log("time per taxel, us"),
            y: Axis::log("largest distance from the exact solution, Pa"),
            lines: self.drawn().map(|(contender, cells)| line(contender, cells)).collect(),
            bands: vec![
                Level::new(STEP_PA, "next f64 at 70 kPa"),
                Level::new(self.half_count_pa, format!("half a count: {} Pa", three_digits(self.half_count_pa))),
                Level::new(
                    GAUGE_ACCURACY * TOP_PA,
                    format!("accuracy of the gauge, {} %: {} Pa", 100.0 * GAUGE_ACCURACY, GAUGE_ACCURACY * TOP_PA),
                ),
            ],
            levels: Vec::new(),
        }
    }

    /// All but the exact variant of ours, which has the place of the plain one and is in the table.
    fn drawn(&self) -> impl Iterator<Item = (&Contender, &Vec<Cell>)> {
        self.contenders.iter().zip(&self.cells).filter(|(contender, _)| !contender.is_exact())
    }

    /// Whether a method has a solution for each taxel that is off by half a count at most.
    pub fn is_useful(&self, cell: &Cell) -> bool {
        cell.error_pa() <= self.half_count_pa
    }
}

fn line(contender: &Contender, cells: &[Cell]) -> Line {
    let point = |(order, cell): (usize, &Cell)| {
        let x_spread = Some((quantile(&cell.us, 0.05), quantile(&cell.us, 0.95)));
        let mark = if [1, 5, MAX_ORDER].contains(&order) { order.to_string() } else { String::new() };
        Point { x: median(&cell.us), x_spread, y: cell.error_pa(), mark }
    };
    let measured: Vec<(usize, &Cell)> = (1..).zip(cells).filter(|(_, cell)| cell.is_measured()).collect();
    let needs = format!("{} (needs {} scans)", contender.name, contender.least_scans());
    let name = if measured.is_empty() { needs } else { contender.name.to_owned() };
    let points = measured.into_iter().map(point).collect();
    Line { name, ours: contender.is_ours(), points, ..Line::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::RAW_SVD;
    use std::path::Path;

    fn measure(panel: Panel, seed: u64) -> Measured {
        panel.measure(seed, &mut Peers::start(Path::new("nowhere"))).unwrap()
    }

    /// Also proves that both sides make the same bins: other bins would be off by pascals.
    #[test]
    fn ours_solves_the_very_problem_that_the_exact_side_solves() {
        for bits in [Bits::Eight, Bits::Sixteen] {
            let measured = measure(Panel { bits, scans: 700, taxels: 2, repetitions: 2 }, 3);
            for (contender, cells) in measured.contenders.iter().zip(&measured.cells) {
                assert_eq!(cells.len(), MAX_ORDER);
                for cell in cells.iter().filter(|_| contender.is_ours()) {
                    assert!(cell.error_pa() < 1e-9, "{bits:?} {}: {} Pa", contender.name, cell.error_pa());
                    assert_eq!(cell.us.len(), 2);
                }
            }
            let svd = measured.contenders.iter().position(|contender| contender.name == RAW_SVD);
            assert!(measured.cells[svd.unwrap()].iter().any(|cell| !measured.is_useful(cell)));
        }
    }

    #[test]
    fn too_few_scans_for_bins_are_an_empty_line_that_says_so() {
        let panel = Panel { bits: Bits::Eight, scans: 100, taxels: 1, repetitions: 1 };
        let figure = measure(panel, 1).figure();
        let empty: Vec<&Line> = figure.lines.iter().filter(|line| line.points.is_empty()).collect();
        assert_eq!(empty.len(), 1);
        assert!(empty[0].name.contains("needs 280 scans"), "{}", empty[0].name);
    }
}
