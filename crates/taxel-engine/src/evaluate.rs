//! From counts to force: tables for the active model set at the present zero.
//!
//! Counts have eight bits, so everything that depends on one taxel's count alone (curve, range, activation threshold,
//! area) is baked into a table of 256 entries when the zero or the model set changes. A scan then costs one load and
//! one addition a taxel, and an excluded taxel costs nothing.

use std::ops::Range;
use std::sync::Arc;
use taxel_model::{RangeState, Sign, TaxelModel};
use taxel_skin::SquareMillimetre;

use crate::model_set::ModelSet;
use crate::rest::TaxelBaseline;
use crate::snapshot::RangeFlag;

/// Rest noise cannot be known better than the quantisation of one count: 1/sqrt(12).
const NOISE_FLOOR_COUNTS: f64 = 0.29;

/// Entries from one force table to the next. Taxels at rest all read about the same count; if their tables lay a power
/// of two apart, all those entries would compete for the same few sets of the cache (5,000 taxels: 7 us instead of 4).
const FORCE_STRIDE: usize = 256 + 16;

/// Force by raw count; the entries beyond 255 are never read.
type ForceTable = [f32; FORCE_STRIDE];

/// One taxel's tables, indexed by raw count.
#[derive(Clone, Debug)]
struct TaxelTable {
    pressure_kpa: [f32; 256],
    sigma_kpa: [f32; 256],
    range: [RangeFlag; 256],
    /// Force in newton with the weaker threshold that holds beside an activated taxel.
    weak_n: [f32; 256],
}

/// What a taxel's count means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelReading {
    /// Pressure, clamped to the calibrated range.
    pub pressure_kpa: f32,
    /// Its standard uncertainty.
    pub sigma_kpa: f32,
    /// Whether it was clamped.
    pub range: RangeFlag,
    /// Whether the count is beyond the activation threshold.
    pub active: bool,
}

/// When a taxel counts as touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// Multiple of the rest noise.
    pub sigmas: f64,
    /// Least distance from rest, in counts.
    pub floor_counts: f64,
}

/// Beside an activated taxel this share of the threshold suffices.
const WEAK_SHARE: f64 = 0.375;

/// The tables of a patch, all by taxel.
#[derive(Clone, Debug)]
pub struct Evaluator {
    set: Arc<ModelSet>,
    /// `None` without a usable model.
    tables: Vec<Option<Box<TaxelTable>>>,
    /// Force in newton by count; zero below the activation threshold and without a usable model.
    force_n: Vec<ForceTable>,
    /// Which taxels count in the sum now: usable, fresh and free of faults.
    selected: Vec<bool>,
    /// The same as runs of neighbours in number.
    runs: Vec<Range<usize>>,
}

impl Evaluator {
    /// Tables for `set` at the zero `rest`. Taxels without a usable model get none.
    ///
    /// All slices have one entry per taxel of the patch.
    #[must_use]
    pub fn new(set: Arc<ModelSet>, rest: &[TaxelBaseline], areas: &[SquareMillimetre], activation: Activation) -> Self {
        let taxels = set.taxels.len();
        let mut evaluator = Self {
            tables: vec![None; taxels],
            force_n: vec![[0.0; FORCE_STRIDE]; taxels],
            selected: vec![],
            runs: vec![],
            set,
        };
        for taxel in 0..taxels {
            let (model, then) = (&evaluator.set.taxels[taxel], evaluator.set.baseline.get(taxel));
            if let (Some(now), Some(then), Some(area)) = (rest.get(taxel), then, areas.get(taxel))
                // A zero or a reference that was never measured proves nothing about the taxel.
                && (model.is_usable() && now.mean.is_finite() && then.mean.is_finite())
            {
                let (table, force_n) = tabulate(model, *now, *then, *area, activation);
                evaluator.tables[taxel] = Some(Box::new(table));
                evaluator.force_n[taxel] = force_n;
            }
        }
        evaluator.select(|_| true);
        evaluator
    }

    /// The model set.
    #[must_use]
    pub const fn set(&self) -> &Arc<ModelSet> {
        &self.set
    }

    /// Keeps for the sum only the taxels that `counts_now` says yes to, among those with a usable model.
    pub fn select(&mut self, counts_now: impl Fn(usize) -> bool) {
        self.selected = (0..self.tables.len()).map(|taxel| self.tables[taxel].is_some() && counts_now(taxel)).collect();
        self.runs.clear();
        for taxel in self.selected.iter().enumerate().filter(|(_, s)| **s).map(|(taxel, _)| taxel) {
            match self.runs.last_mut() {
                Some(run) if run.end == taxel => run.end += 1,
                _ => self.runs.push(taxel..taxel + 1),
            }
        }
    }

    /// The taxels that count in the sum now, ascending.
    pub fn selected(&self) -> impl Iterator<Item = usize> + '_ {
        self.runs.iter().cloned().flatten()
    }

    /// Sum of area x pressure in newton over selected taxels beyond their activation threshold. `counts` has one entry
    /// per taxel.
    ///
    /// The order of addition is fixed, so that a replay gives the same bits.
    #[must_use]
    pub fn total_n(&self, counts: &[u8]) -> f64 {
        // Eight chains of additions, or the latency of one would set the pace.
        let mut lanes = [0.0_f64; 8];
        for run in &self.runs {
            let (tables, counts) = (&self.force_n[run.clone()], &counts[run.clone()]);
            let (tables8, tables) = tables.as_chunks::<8>();
            let (counts8, counts) = counts.as_chunks::<8>();
            for (tables, counts) in tables8.iter().zip(counts8) {
                for ((lane, table), &count) in lanes.iter_mut().zip(tables).zip(counts) {
                    *lane += f64::from(table[usize::from(count)]);
                }
            }
            for (lane, (table, &count)) in lanes.iter_mut().zip(tables.iter().zip(counts)) {
                *lane += f64::from(table[usize::from(count)]);
            }
        }
        lanes.iter().fold(0.0, |sum, lane| sum + lane)
    }

    /// The selected taxels that are active, with their force in newton.
    pub fn active<'a>(&'a self, counts: &'a [u8]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let forces = self.selected().map(|taxel| (taxel, f64::from(self.force_n[taxel][usize::from(counts[taxel])])));
        forces.filter(|&(_, force)| force > 0.0)
    }

    /// Force in newton of a taxel beside an activated one, where a weaker touch counts; `None` if it is not selected.
    #[must_use]
    pub fn weak_n(&self, taxel: usize, count: u8) -> Option<f64> {
        let table = self.tables.get(taxel)?.as_ref()?;
        self.selected[taxel].then(|| f64::from(table.weak_n[usize::from(count)]))
    }

    /// What `count` means for `taxel`; `None` without a usable model.
    #[must_use]
    pub fn reading(&self, taxel: usize, count: u8) -> Option<TaxelReading> {
        let (table, code) = (self.tables.get(taxel)?.as_ref()?, usize::from(count));
        Some(TaxelReading {
            pressure_kpa: table.pressure_kpa[code],
            sigma_kpa: table.sigma_kpa[code],
            range: table.range[code],
            active: self.force_n[taxel][code] > 0.0,
        })
    }
}

/// One taxel's tables: what is looked up now and then, and the force that every scan needs.
fn tabulate(
    model: &TaxelModel,
    now: TaxelBaseline,
    then: TaxelBaseline,
    area: SquareMillimetre,
    activation: Activation,
) -> (TaxelTable, ForceTable) {
    let table = model.tabulate(then.mean - now.mean);
    let range = std::array::from_fn(|code| in_pressure(table.range_state(code as u8), model.sign));
    let distance = (activation.sigmas * now.noise.max(NOISE_FLOOR_COUNTS)).max(activation.floor_counts);
    let beyond = |distance: f64| -> [f32; 256] {
        std::array::from_fn(|code| {
            let pressed = model.sign.as_f64() * (code as f64 - now.mean);
            let newton = f64::from(table.pressure_kpa[code]) * area.0 * 1e-3;
            if pressed > distance { newton.max(0.0) as f32 } else { 0.0 }
        })
    };
    let weak_n = beyond(WEAK_SHARE * distance);
    let mut force_n = [0.0; FORCE_STRIDE];
    force_n[..256].copy_from_slice(&beyond(distance));
    let (pressure_kpa, sigma_kpa) = (table.pressure_kpa, table.sigma_kpa);
    (TaxelTable { pressure_kpa, sigma_kpa, range, weak_n }, force_n)
}

/// Beyond which end of the pressure a count lies: where counts fall with pressure, few counts are much pressure.
const fn in_pressure(counts: RangeState, sign: Sign) -> RangeFlag {
    match (counts, sign) {
        (RangeState::InRange, _) => RangeFlag::In,
        (RangeState::Below, Sign::Rising) | (RangeState::Above, Sign::Falling) => RangeFlag::Below,
        (RangeState::Above, Sign::Rising) | (RangeState::Below, Sign::Falling) => RangeFlag::Above,
    }
}
