//! From counts to force: tables for the active model set at the present zero.
//!
//! Counts have eight bits, so everything that depends on one taxel's count alone (curve, range, activation threshold,
//! area) is baked into a table of 256 entries when the zero or the model set changes. A scan then costs one load and
//! one addition a taxel, and an excluded taxel costs nothing.

use std::sync::Arc;
use taxel_model::{RangeState, Sign};
use taxel_skin::SquareMillimetre;

use crate::model_set::ModelSet;
use crate::rest::TaxelBaseline;
use crate::snapshot::RangeFlag;

/// Rest noise cannot be known better than the quantisation of one count: 1/sqrt(12).
const NOISE_FLOOR_COUNTS: f64 = 0.29;

/// One taxel's tables, indexed by raw count.
#[derive(Clone, Debug)]
struct TaxelTable {
    /// Taxel of the patch.
    taxel: u16,
    pressure_kpa: [f32; 256],
    sigma_kpa: [f32; 256],
    range: [RangeFlag; 256],
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

/// The tables of a patch.
#[derive(Clone, Debug)]
pub struct Evaluator {
    set: Arc<ModelSet>,
    tables: Vec<TaxelTable>,
    /// Position in `tables` by taxel; `None` without a usable model.
    table_of: Vec<Option<u16>>,
    /// Force in newton by position in `tables` and count; zero below the activation threshold.
    force_n: Vec<[f32; 256]>,
    /// The same with the weaker threshold that holds beside an activated taxel.
    weak_n: Vec<[f32; 256]>,
    /// Which tables count, by taxel.
    selected: Vec<bool>,
    /// The tables that count now: usable, fresh and free of faults.
    selection: Vec<(u16, u16)>,
}

impl Evaluator {
    /// Tables for `set` at the zero `rest`. Taxels without a usable model get none.
    ///
    /// All slices have one entry per taxel of the patch.
    #[must_use]
    pub fn new(set: Arc<ModelSet>, rest: &[TaxelBaseline], areas: &[SquareMillimetre], activation: Activation) -> Self {
        let mut evaluator = Self {
            tables: Vec::new(),
            table_of: vec![None; set.taxels.len()],
            force_n: Vec::new(),
            weak_n: Vec::new(),
            selected: Vec::new(),
            selection: Vec::new(),
            set: Arc::clone(&set),
        };
        for (taxel, model) in set.taxels.iter().enumerate() {
            let (Some(now), Some(then), Some(area)) = (rest.get(taxel), set.baseline.get(taxel), areas.get(taxel))
            else {
                continue;
            };
            // A zero or a reference that was never measured proves nothing about the taxel.
            if !model.is_usable() || !now.mean.is_finite() || !then.mean.is_finite() {
                continue;
            }
            let table = model.tabulate(then.mean - now.mean);
            let range = std::array::from_fn(|code| in_pressure(table.range_state(code as u8), model.sign));
            let distance = (activation.sigmas * now.noise.max(NOISE_FLOOR_COUNTS)).max(activation.floor_counts);
            let beyond = |distance: f64| {
                std::array::from_fn(|code| {
                    let pressed = model.sign.as_f64() * (code as f64 - now.mean);
                    let newton = f64::from(table.pressure_kpa[code]) * area.0 * 1e-3;
                    if pressed > distance { newton.max(0.0) as f32 } else { 0.0 }
                })
            };
            evaluator.table_of[taxel] = Some(evaluator.tables.len() as u16);
            evaluator.force_n.push(beyond(distance));
            evaluator.weak_n.push(beyond(WEAK_SHARE * distance));
            evaluator.tables.push(TaxelTable {
                taxel: taxel as u16,
                pressure_kpa: table.pressure_kpa,
                sigma_kpa: table.sigma_kpa,
                range,
            });
        }
        evaluator.select(|_| true);
        evaluator
    }

    /// The model set.
    #[must_use]
    pub const fn set(&self) -> &Arc<ModelSet> {
        &self.set
    }

    /// Keeps for the sum only the taxels that `counts_now` says yes to.
    pub fn select(&mut self, counts_now: impl Fn(usize) -> bool) {
        let kept = self.tables.iter().enumerate().filter(|(_, table)| counts_now(table.taxel as usize));
        self.selection = kept.map(|(position, table)| (position as u16, table.taxel)).collect();
        self.selected = vec![false; self.table_of.len()];
        for &(_, taxel) in &self.selection {
            self.selected[taxel as usize] = true;
        }
    }

    /// The taxels that count in the sum now, ascending.
    pub fn selected(&self) -> impl Iterator<Item = usize> + '_ {
        self.selection.iter().map(|&(_, taxel)| taxel as usize)
    }

    /// Sum of area x pressure in newton over selected taxels beyond their activation threshold.
    ///
    /// The order of addition is fixed, so that a replay gives the same bits.
    #[must_use]
    pub fn total_n(&self, counts: &[u8]) -> f64 {
        // Eight chains of additions, or the latency of one would set the pace.
        let mut lanes = [0.0_f64; 8];
        let mut chunks = self.selection.chunks_exact(8);
        for chunk in &mut chunks {
            for (lane, &entry) in lanes.iter_mut().zip(chunk) {
                *lane += self.force(entry, counts);
            }
        }
        for (lane, &entry) in lanes.iter_mut().zip(chunks.remainder()) {
            *lane += self.force(entry, counts);
        }
        lanes.iter().sum()
    }

    #[inline]
    fn force(&self, (position, taxel): (u16, u16), counts: &[u8]) -> f64 {
        let count = counts.get(taxel as usize).copied().unwrap_or(0);
        f64::from(self.force_n[position as usize][count as usize])
    }

    /// The selected taxels that are active, with their force in newton.
    pub fn active<'a>(&'a self, counts: &'a [u8]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let forces = self.selection.iter().map(|&entry| (entry.1 as usize, self.force(entry, counts)));
        forces.filter(|&(_, force)| force > 0.0)
    }

    /// Force in newton of a taxel beside an activated one, where a weaker touch counts; `None` if it is not selected.
    #[must_use]
    pub fn weak_n(&self, taxel: usize, count: u8) -> Option<f64> {
        let position = (*self.table_of.get(taxel)?)? as usize;
        self.selected[taxel].then(|| f64::from(self.weak_n[position][count as usize]))
    }

    /// What `count` means for `taxel`; `None` without a usable model.
    #[must_use]
    pub fn reading(&self, taxel: usize, count: u8) -> Option<TaxelReading> {
        let position = (*self.table_of.get(taxel)?)? as usize;
        let (table, code) = (&self.tables[position], count as usize);
        Some(TaxelReading {
            pressure_kpa: table.pressure_kpa[code],
            sigma_kpa: table.sigma_kpa[code],
            range: table.range[code],
            active: self.force_n[position][code] > 0.0,
        })
    }
}

/// Beyond which end of the pressure a count lies: where counts fall with pressure, few counts are much pressure.
const fn in_pressure(counts: RangeState, sign: Sign) -> RangeFlag {
    match (counts, sign) {
        (RangeState::InRange, _) => RangeFlag::In,
        (RangeState::Below, Sign::Rising) | (RangeState::Above, Sign::Falling) => RangeFlag::Below,
        (RangeState::Above, Sign::Rising) | (RangeState::Below, Sign::Falling) => RangeFlag::Above,
    }
}
