//! From counts to force, scan by scan: which taxels count now, and which of them are touched.
//!
//! Most of a skin is untouched most of the time. So one pass compares all counts with their thresholds, sixteen at a
//! time, and only blocks with a touch look anything up; an excluded taxel has a threshold that no count is beyond.

use std::sync::Arc;
use taxel_skin::SquareMillimetre;

use crate::baseline::{Activation, TaxelBaseline};
use crate::counts::Counts;
use crate::force::offsets::{self, Offsets};
use crate::force::tables::{NEVER, Tables, TaxelReading};
use crate::model_set::ModelSet;

/// Taxels that are compared at a time.
const BLOCK: usize = 16;

/// The evaluation of a patch.
#[derive(Clone, Debug)]
pub struct Evaluator {
    tables: Arc<Tables>,
    /// Which taxels count in the sum now: usable, fresh and free of faults.
    selected: Vec<bool>,
    /// The threshold of each taxel; [`NEVER`] for one that does not count now.
    threshold: Vec<u16>,
    /// What the history of each taxel adds to its pressure; `None` where hysteresis is not compensated.
    offsets: Option<Offsets>,
}

impl Evaluator {
    /// An evaluator for `set` at the zero `rest`; every taxel with a usable model counts.
    ///
    /// All slices have one entry per taxel of the patch.
    pub fn new(set: Arc<ModelSet>, rest: &[TaxelBaseline], areas: &[SquareMillimetre], activation: Activation) -> Self {
        Self::of(Tables::new(set, rest, areas, activation))
    }

    /// An evaluator that looks up in `tables`; every taxel with a usable model counts.
    pub fn of(tables: Tables) -> Self {
        let tables = Arc::new(tables);
        let mut evaluator = Self { tables, selected: vec![], threshold: vec![], offsets: None };
        evaluator.select(|_| true);
        evaluator
    }

    /// The tables, for readers of snapshots.
    pub const fn tables(&self) -> &Arc<Tables> {
        &self.tables
    }

    /// Keeps for the sum only the taxels that `counts_now` says yes to, among those with a usable model.
    pub fn select(&mut self, counts_now: impl Fn(usize) -> bool) {
        let tables = &self.tables;
        self.selected = (0..tables.taxels()).map(|taxel| tables.has(taxel) && counts_now(taxel)).collect();
        let threshold = |(taxel, selected): (usize, &bool)| if *selected { tables.threshold(taxel) } else { NEVER };
        self.threshold = self.selected.iter().enumerate().map(threshold).collect();
    }

    /// From now on the history of each taxel adds this to its pressure.
    pub fn set_hysteresis(&mut self, offsets: Option<Offsets>) {
        self.offsets = offsets.filter(|offsets| offsets.taxels() == self.tables.taxels());
    }

    /// What the history of each taxel adds, if hysteresis is compensated.
    pub const fn hysteresis(&self) -> Option<&Offsets> {
        self.offsets.as_ref()
    }

    /// Whether each taxel counts in the sum now.
    pub fn selection(&self) -> &[bool] {
        &self.selected
    }

    /// The taxels that count in the sum now, ascending.
    pub fn selected(&self) -> impl Iterator<Item = usize> + '_ {
        self.selected.iter().enumerate().filter(|(_, selected)| **selected).map(|(taxel, _)| taxel)
    }

    /// The selected taxels that are active, with their force in newton, ascending.
    pub fn active<'a>(&self, counts: impl Into<Counts<'a>>) -> Vec<(usize, f64)> {
        let mut active = Vec::new();
        self.find_active(counts.into(), &mut active);
        active
    }

    /// As [`Evaluator::active`], appended to `active`.
    pub fn find_active(&self, counts: Counts<'_>, active: &mut Vec<(usize, f64)>) {
        let mut look = |taxel: usize, count: u16| {
            if count ^ self.tables.polarity()[taxel] > self.threshold[taxel] {
                let newton = self.with_hysteresis_n(taxel, self.tables.newton(taxel, count));
                if newton > 0.0 {
                    active.push((taxel, newton));
                }
            }
        };
        let (blocks, rest) = counts.all().as_chunks::<BLOCK>();
        let thresholds =
            self.tables.polarity().as_chunks::<BLOCK>().0.iter().zip(self.threshold.as_chunks::<BLOCK>().0);
        for (block, (counts, (polarity, threshold))) in blocks.iter().zip(thresholds).enumerate() {
            if any_touched(counts, polarity, threshold) {
                counts.iter().enumerate().for_each(|(i, &count)| look(block * BLOCK + i, count));
            }
        }
        rest.iter().enumerate().for_each(|(i, &count)| look(blocks.len() * BLOCK + i, count));
    }

    /// A force of the curve with what its history adds; no touch stays none.
    fn with_hysteresis_n(&self, taxel: usize, newton: f32) -> f64 {
        match &self.offsets {
            Some(offsets) if newton > 0.0 => {
                f64::from((newton + offsets.kpa(taxel) * self.tables.newton_per_kpa(taxel)).max(0.0))
            }
            _ => f64::from(newton),
        }
    }

    /// Force in newton of a taxel beside an activated one, where a weaker touch counts; nothing if it is not selected.
    pub fn low_n(&self, taxel: usize, count: u16) -> f64 {
        if self.selected[taxel] { self.with_hysteresis_n(taxel, self.tables.low_n(taxel, count)) } else { 0.0 }
    }

    /// What `count` means for `taxel`; `None` without a usable model.
    pub fn reading(&self, taxel: usize, count: impl Into<u16>) -> Option<TaxelReading> {
        offsets::reading(&self.tables, self.offsets.as_ref(), taxel, count)
    }
}

/// Whether a taxel of the block is beyond its threshold. Arrays of a known length: the compiler makes a few vector
/// instructions of it.
fn any_touched(counts: &[u16; BLOCK], polarity: &[u16; BLOCK], threshold: &[u16; BLOCK]) -> bool {
    let mut any = 0;
    for i in 0..BLOCK {
        any |= u16::from(counts[i] ^ polarity[i] > threshold[i]);
    }
    any != 0
}
