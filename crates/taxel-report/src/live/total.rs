//! Evaluate and sum: what a scan costs in the daemon, beside other safe ways to the same force.

use std::sync::Arc;

use taxel_engine::baseline::TaxelBaseline;
use taxel_engine::force::{Activation, Evaluator};
use taxel_engine::model_set::ModelSet;
use taxel_model::TaxelModel;
use taxel_skin::SquareMillimetre;

use crate::live::methods::LANES;
use crate::live::skin::{REST_COUNT, Taxel};

/// Noise at rest, counts.
const REST_NOISE_COUNTS: f64 = 0.7;

/// The activation rule that a scene has by default.
const ACTIVATION: Activation = Activation { sigmas: 4.0, floor_counts: 2.0 };

/// Force per pressure of one taxel, N/kPa.
fn newton_per_kpa() -> f64 {
    SquareMillimetre::ICUB_TAXEL.0 * 1e-3
}

/// A count below this one is touched: all synthetic taxels fall with pressure.
fn touched_below() -> f64 {
    REST_COUNT - (ACTIVATION.sigmas * REST_NOISE_COUNTS).max(ACTIVATION.floor_counts)
}

/// The engine's own evaluator for `models` at rest.
#[must_use]
pub fn evaluator(models: &[TaxelModel]) -> Evaluator {
    let baseline = vec![TaxelBaseline { mean: REST_COUNT, noise: REST_NOISE_COUNTS }; models.len()];
    let areas = vec![SquareMillimetre::ICUB_TAXEL; models.len()];
    let set = ModelSet {
        id: "m-synthetic".to_owned(),
        patch: "synthetic".to_owned(),
        created_wall_ns: 0,
        session: None,
        method: "synthetic".to_owned(),
        board_settings: Vec::new(),
        baseline: baseline.clone(),
        pressure_max_kpa: 70.0,
        gauge_gain_rel: 0.0,
        gauge_offset_kpa: 0.0,
        taxels: models.to_vec(),
        recorded: None,
        recalibrated: None,
    };
    Evaluator::new(Arc::new(set), &baseline, &areas, ACTIVATION)
}

/// The force of every count of every taxel, N: zero where it is not touched.
#[must_use]
pub fn exact_newton(exact_kpa: &[[f64; 256]]) -> Vec<[f64; 256]> {
    let edge = touched_below();
    let of = |kpa: &[f64; 256]| -> [f64; 256] {
        std::array::from_fn(|c| if (c as f64) < edge { (kpa[c] * newton_per_kpa()).max(0.0) } else { 0.0 })
    };
    exact_kpa.iter().map(of).collect()
}

/// A scan of counts to a force in newton.
pub trait Total {
    /// The sum over all touched taxels.
    fn total_n(&self, counts: &[u8]) -> f64;
}

impl Total for Evaluator {
    fn total_n(&self, counts: &[u8]) -> f64 {
        Self::total_n(self, counts)
    }
}

/// What is kept of a taxel's table of forces: from the hard end of its range to the first count that is not touched.
#[derive(Clone, Copy, Debug)]
struct Span {
    first: u32,
    low: u8,
    high: u8,
}

/// Tables of touched counts alone, one after the other.
pub struct TrimmedForces {
    spans: Vec<Span>,
    forces: Vec<f32>,
}

impl TrimmedForces {
    /// The nearest f32 of every force.
    #[must_use]
    pub fn new(taxels: &[Taxel], exact_n: &[[f64; 256]]) -> Self {
        let high = touched_below().ceil() as u8;
        let mut trimmed = Self { spans: Vec::with_capacity(taxels.len()), forces: Vec::new() };
        for (taxel, exact) in taxels.iter().zip(exact_n) {
            let low = (taxel.range[0].floor() as u8).min(high);
            trimmed.spans.push(Span { first: trimmed.forces.len() as u32, low, high });
            trimmed.forces.extend(exact[usize::from(low)..=usize::from(high)].iter().map(|force| *force as f32));
        }
        trimmed
    }
}

impl Total for TrimmedForces {
    fn total_n(&self, counts: &[u8]) -> f64 {
        // Eight sums, as the engine has them, because one addition would wait for the other.
        let mut lanes = [0.0; 8];
        for (spans, counts) in self.spans.chunks(8).zip(counts.chunks(8)) {
            for ((lane, span), &count) in lanes.iter_mut().zip(spans).zip(counts) {
                let entry = span.first as usize + usize::from(count.max(span.low).min(span.high) - span.low);
                // The entry is always there; the check costs less than what would follow from a wrong one.
                *lane += self.forces.get(entry).copied().map_or(0.0, f64::from);
            }
        }
        lanes.iter().sum()
    }
}

/// The engine's own layout, but added in f32 eight times before f64 takes over: an addition straight from memory
/// instead of a load, a conversion and an addition. With `SKIP` sixteen taxels none of which is touched are passed over.
pub struct PartialSums<const SKIP: bool> {
    forces: Vec<[f32; FORCE_STRIDE]>,
    edge: u8,
}

/// As `taxel_engine::force` has it.
const FORCE_STRIDE: usize = 256 + 16;

impl<const SKIP: bool> PartialSums<SKIP> {
    /// The nearest f32 of every force.
    #[must_use]
    pub fn new(exact_n: &[[f64; 256]]) -> Self {
        let table = |exact: &[f64; 256]| std::array::from_fn(|count| exact.get(count).map_or(0.0, |n| *n as f32));
        Self { forces: exact_n.iter().map(table).collect(), edge: touched_below().ceil() as u8 }
    }
}

impl<const SKIP: bool> Total for PartialSums<SKIP> {
    fn total_n(&self, counts: &[u8]) -> f64 {
        let mut lanes = [0.0_f64; 8];
        let (tables16, tables) = self.forces.as_chunks::<16>();
        let (counts16, counts) = counts.as_chunks::<16>();
        for (tables, counts) in tables16.chunks(4).zip(counts16.chunks(4)) {
            let mut partial = [0.0_f32; 8];
            for (tables, counts) in tables.iter().zip(counts) {
                if SKIP && counts.iter().fold(u8::MAX, |least, count| least.min(*count)) >= self.edge {
                    continue;
                }
                let (tables, counts) = (tables.as_chunks::<8>().0, counts.as_chunks::<8>().0);
                for (tables, counts) in tables.iter().zip(counts) {
                    for ((sum, table), &count) in partial.iter_mut().zip(tables).zip(counts) {
                        *sum += table[usize::from(count)];
                    }
                }
            }
            lanes.iter_mut().zip(partial).for_each(|(lane, sum)| *lane += f64::from(sum));
        }
        for (table, &count) in tables.iter().zip(counts) {
            lanes[0] += f64::from(table[usize::from(count)]);
        }
        lanes.iter().fold(0.0, |sum, lane| sum + lane)
    }
}

/// Horner's rule in f32 on s = (C - centre) / half width, with range, threshold and area, `LANES` taxels side by side.
pub struct HornerForces<const N: usize>(Vec<HornerBlock<N>>);

struct HornerBlock<const N: usize> {
    low: [f32; LANES],
    high: [f32; LANES],
    edge: [f32; LANES],
    centre: [f32; LANES],
    per_half_width: [f32; LANES],
    /// N, in powers of s.
    coefficients: [[f32; LANES]; N],
}

impl<const N: usize> HornerForces<N> {
    /// Taxels that fill up the last block are never touched.
    #[must_use]
    pub fn new(taxels: &[Taxel]) -> Self {
        let block = |taxels: &[Taxel]| {
            let each = |missing: f64, value: &dyn Fn(&Taxel) -> f64| -> [f32; LANES] {
                std::array::from_fn(|lane| taxels.get(lane).map_or(missing, value) as f32)
            };
            let scaled: Vec<Vec<f64>> = taxels.iter().map(Taxel::scaled).collect();
            let coefficient =
                |k: usize, lane: usize| scaled.get(lane).and_then(|list| list.get(k)).copied().unwrap_or(0.0);
            let newton = |k: usize, lane: usize| (coefficient(k, lane) * newton_per_kpa()) as f32;
            HornerBlock {
                low: each(0.0, &|taxel| taxel.range[0]),
                high: each(0.0, &|taxel| taxel.range[1]),
                edge: each(-1.0, &|_| touched_below()),
                centre: each(0.0, &|taxel| taxel.curve.centre),
                per_half_width: each(1.0, &|taxel| 1.0 / taxel.curve.half_width),
                coefficients: std::array::from_fn(|k| std::array::from_fn(|lane| newton(k, lane))),
            }
        };
        Self(taxels.chunks(LANES).map(block).collect())
    }
}

impl<const N: usize> HornerBlock<N> {
    #[inline]
    fn add(&self, sums: &mut [f32; LANES], counts: &[u8; LANES]) {
        let count: [f32; LANES] = counts.map(f32::from);
        let s: [f32; LANES] = std::array::from_fn(|lane| {
            let above = if count[lane] > self.low[lane] { count[lane] } else { self.low[lane] };
            let inside = if above < self.high[lane] { above } else { self.high[lane] };
            (inside - self.centre[lane]) * self.per_half_width[lane]
        });
        let mut force = self.coefficients[N - 1];
        for coefficients in self.coefficients[..N - 1].iter().rev() {
            force = std::array::from_fn(|lane| force[lane] * s[lane] + coefficients[lane]);
        }
        *sums = std::array::from_fn(|lane| {
            let pressed = if force[lane] > 0.0 { force[lane] } else { 0.0 };
            sums[lane] + if count[lane] < self.edge[lane] { pressed } else { 0.0 }
        });
    }
}

impl<const N: usize> Total for HornerForces<N> {
    fn total_n(&self, counts: &[u8]) -> f64 {
        let mut sums = [0.0; LANES];
        let (whole, left) = counts.as_chunks::<LANES>();
        for (block, counts) in self.0.iter().zip(whole) {
            block.add(&mut sums, counts);
        }
        if let Some(block) = self.0.last().filter(|_| !left.is_empty()) {
            let mut padded = [u8::MAX; LANES];
            padded[..left.len()].copy_from_slice(left);
            block.add(&mut sums, &padded);
        }
        sums.iter().fold(0.0, |sum, lane| sum + f64::from(*lane))
    }
}
