//! One diagram: all contenders at all orders on one recording.

use super::contenders::{Contender, Fitted, contenders};
use super::exact::{Problem, Solution, rows, solve};
use super::taxels::{Bits, Recording};
use crate::document::{Axis, Band, Figure, Line, Point};
use crate::markup::three_digits;
use crate::numpy::Numpy;
use taxel_model::Dd;

/// The knob's end: orders 1 to this are swept.
pub(super) const MAX_ORDER: usize = 9;

/// Pressure at the top of the calibration, Pa.
const TOP_PA: f64 = 70_000.0;

/// Distance of neighbouring f64 at 70 kPa, which is 2^-46 kPa, in Pa.
const ULP_PA: f64 = 1000.0 / (1_u64 << 46) as f64;

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

/// The 5, 50 and 95 % points.
pub(super) fn quantiles(values: &[f64]) -> (f64, f64, f64) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((share * sorted.len().saturating_sub(1) as f64).round() as usize).copied();
    let at = |share: f64| at(share).unwrap_or(f64::NAN);
    (at(0.05), at(0.5), at(0.95))
}

impl Cell {
    pub fn median_us(&self) -> f64 {
        quantiles(&self.us).1
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

/// Exact pressures of one taxel: both problems, all orders.
struct Judge {
    per_sample: Vec<Solution>,
    binned: Vec<Solution>,
    /// `per_sample` at all observed counts, by order.
    at_codes: Vec<Vec<Dd>>,
}

impl Judge {
    fn new(recording: &Recording, taxel: usize) -> Self {
        let solved = |problem| solve(&rows(recording, taxel, problem), MAX_ORDER);
        let per_sample: Vec<Solution> = solved(Problem::PerSample);
        let codes = &recording.taxels[taxel].codes;
        let at_codes = per_sample.iter().map(|solution| codes.iter().map(|c| solution.evaluate(*c)).collect());
        Self { at_codes: at_codes.collect(), per_sample, binned: solved(Problem::PressureBinned) }
    }

    /// Greatest error over all observed counts, Pa; `None` without a curve or a solution.
    fn error_pa(&self, fitted: &Fitted, problem: Problem, order: usize, codes: &[f64]) -> Option<f64> {
        match problem {
            Problem::PerSample => {
                let at_codes = self.at_codes.get(order - 1)?;
                worst_pa(
                    fitted,
                    self.per_sample.get(order - 1)?,
                    codes.iter().zip(at_codes.iter().map(|kpa| Some(*kpa))),
                )
            }
            Problem::PressureBinned => {
                worst_pa(fitted, self.binned.get(order - 1)?, codes.iter().zip(std::iter::repeat(None)))
            }
        }
    }
}

/// Greatest distance of the curve from `solution` over all counts, Pa; a count may come with its exact pressure, where
/// it is known already. `None` without a curve, or where it is not finite.
fn worst_pa<'a>(
    fitted: &Fitted,
    solution: &Solution,
    codes: impl Iterator<Item = (&'a f64, Option<Dd>)>,
) -> Option<f64> {
    let curve = fitted.curve.as_ref()?;
    let mut worst = 0.0_f64;
    for (code, known) in codes {
        let (count, kpa) = curve.evaluate(*code);
        let exact = known.filter(|_| count == *code).unwrap_or_else(|| solution.evaluate(count));
        let error_pa = 1000.0 * (Dd::from(kpa) - exact).hi.abs();
        // Not `max`, which would lose a NaN.
        if error_pa.is_nan() || error_pa > worst {
            worst = error_pa;
        }
    }
    Some(worst).filter(|worst| worst.is_finite())
}

/// Worst error over all taxels, Pa, of `contender` at `order`; infinite if it fails on one.
pub(super) fn worst_error_pa(contender: &Contender, recording: &Recording, order: usize) -> anyhow::Result<f64> {
    let mut worst = 0.0_f64;
    for (at, taxel) in recording.taxels.iter().enumerate() {
        let fitted = contender.fit(recording, at, order, &mut None)?;
        let solutions = solve(&rows(recording, at, contender.problem), order);
        let codes = taxel.codes.iter().zip(std::iter::repeat(None));
        let error = solutions.get(order - 1).and_then(|solution| worst_pa(&fitted, solution, codes));
        worst = worst.max(error.unwrap_or(f64::INFINITY));
    }
    Ok(worst)
}

impl Panel {
    pub fn name(&self) -> String {
        format!("{} bit, {} scans", self.bits.number(), self.scans)
    }

    /// Fits every taxel of a simulated recording with every contender at every order, all taking turns.
    pub fn measure(self, seed: u64, numpy: &mut Option<Numpy>) -> anyhow::Result<Measured> {
        let recording = Recording::simulate(self.bits, self.scans, self.taxels, seed);
        if let Some(numpy) = numpy {
            let counts: Vec<&[f64]> = recording.taxels.iter().map(|taxel| taxel.counts.as_slice()).collect();
            numpy.load(&recording.kpa, &counts)?;
        }
        let judges: Vec<Judge> = (0..self.taxels).map(|taxel| Judge::new(&recording, taxel)).collect();
        let contenders = contenders(numpy.is_some());
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
                    contender.fit(&recording, taxel, order, numpy)?;
                    let fitted = contender.fit(&recording, taxel, order, numpy)?;
                    let cell = &mut cells[at][order - 1];
                    cell.us.push(fitted.us);
                    if round < self.taxels {
                        let codes = &recording.taxels[taxel].codes;
                        match judges[taxel].error_pa(&fitted, contender.problem, order, codes) {
                            Some(error_pa) => cell.worst_pa = cell.worst_pa.max(error_pa),
                            None => cell.failed += 1,
                        }
                    }
                }
            }
        }
        let half_counts: Vec<f64> = recording.taxels.iter().map(|taxel| 0.5 * TOP_PA / taxel.swing()).collect();
        Ok(Measured { panel: self, contenders, cells, half_count_pa: quantiles(&half_counts).1 })
    }
}

impl Measured {
    pub fn figure(&self) -> Figure {
        let axis = |label: &str| Axis { label: label.to_owned(), log: true };
        let Panel { bits, scans, taxels, repetitions } = self.panel;
        Figure {
            id: format!("a-fit-{}bit-{scans}", bits.number()),
            caption: format!(
                "{} bit, {scans} scans. Time from samples to curve against the worst error over {taxels} taxels and all \
                 their observed counts, for orders 1 to {MAX_ORDER} (marks). Medians of {} fits, bars from 5 to 95 %. \
                 Lower left is better; what lies below a dotted level is more precise than that.",
                bits.number(),
                repetitions.max(taxels),
            ),
            x: axis("time per taxel, us"),
            y: axis("max |dP| against the exact solution, Pa"),
            lines: self.contenders.iter().zip(&self.cells).map(|(contender, cells)| line(contender, cells)).collect(),
            bands: vec![
                Band { y: ULP_PA, label: "1 ulp of f64 at 70 kPa".to_owned() },
                Band { y: self.half_count_pa, label: format!("half a count: {} Pa", three_digits(self.half_count_pa)) },
                Band {
                    y: GAUGE_ACCURACY * TOP_PA,
                    label: format!(
                        "accuracy of the gauge, {} %: {} Pa",
                        100.0 * GAUGE_ACCURACY,
                        GAUGE_ACCURACY * TOP_PA
                    ),
                },
            ],
        }
    }

    /// The least order at which a method is off by more than half a count or fails.
    pub fn first_useless_order(&self, contender: usize) -> Option<usize> {
        self.cells[contender].iter().position(|cell| cell.error_pa() > self.half_count_pa).map(|at| at + 1)
    }
}

fn line(contender: &Contender, cells: &[Cell]) -> Line {
    let point = |(order, cell): (usize, &Cell)| {
        let (low, median, high) = quantiles(&cell.us);
        Point { x: median, x_spread: Some((low, high)), y: cell.error_pa(), mark: order.to_string() }
    };
    let measured: Vec<(usize, &Cell)> = (1..).zip(cells).filter(|(_, cell)| cell.is_measured()).collect();
    let needs = format!("{} (needs {} scans)", contender.name, contender.least_scans());
    let name = if measured.is_empty() { needs } else { contender.name.to_owned() };
    Line { name, ours: contender.is_ours(), points: measured.into_iter().map(point).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Also proves that both sides make the same bins: other bins would be off by pascals.
    #[test]
    fn ours_solves_the_very_problem_that_the_exact_side_solves() {
        for bits in [Bits::Eight, Bits::Sixteen] {
            let measured = Panel { bits, scans: 700, taxels: 2, repetitions: 2 }.measure(3, &mut None).unwrap();
            for (contender, cells) in measured.contenders.iter().zip(&measured.cells) {
                assert_eq!(cells.len(), MAX_ORDER);
                for cell in cells.iter().filter(|_| contender.is_ours()) {
                    assert!(cell.error_pa() < 1e-9, "{bits:?} {}: {} Pa", contender.name, cell.error_pa());
                    assert_eq!(cell.us.len(), 2);
                }
            }
            let svd = measured.contenders.iter().position(|contender| contender.name == super::super::contenders::SVD);
            assert!(measured.first_useless_order(svd.unwrap()).is_some());
        }
    }

    #[test]
    fn too_few_scans_for_bins_are_an_empty_line_that_says_so() {
        let panel = Panel { bits: Bits::Eight, scans: 100, taxels: 1, repetitions: 1 };
        let figure = panel.measure(1, &mut None).unwrap().figure();
        let empty: Vec<&Line> = figure.lines.iter().filter(|line| line.points.is_empty()).collect();
        assert_eq!(empty.len(), 1);
        assert!(empty[0].name.contains("needs 280 scans"), "{}", empty[0].name);
    }

    #[test]
    fn quantiles_of_few_values() {
        assert_eq!(quantiles(&[3.0, 1.0, 2.0]), (1.0, 2.0, 3.0));
        assert!(quantiles(&[]).1.is_nan());
    }
}
