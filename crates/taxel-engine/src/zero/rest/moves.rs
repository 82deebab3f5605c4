//! How far each taxel of a skin has moved into the direction of load.

use std::ops::Range;

use super::statistics::RestStatistics;
use crate::baseline::TaxelBaseline;
use crate::statistics::median;

/// Fewest taxels of a module that may speak for it; of one that has fewer in all, half of them. A module of one taxel has
/// nobody else to speak for it.
const MODULE_TAXELS_MIN: usize = 5;

/// A taxel with so much noise at rest, in counts, that reads one value for the whole window is broken, not at rest.
const LIFE_COUNTS: f64 = 0.3;

/// Fewer scans of a sound taxel may well all read the same.
const LIFE_SCANS: u64 = 10;

/// How far each taxel moved into the direction of load, counts; NaN for one that takes no part.
#[derive(Clone, Debug)]
pub struct Moves {
    moved: Vec<f64>,
    sound: usize,
    comparable: usize,
}

impl Moves {
    /// From `reference` to the window; `sign` is +1 where the count rises with pressure, -1 where it falls, 0 where that
    /// is not known.
    #[must_use]
    pub fn against(reference: &[TaxelBaseline], now: &RestStatistics, sign: &[i8]) -> Self {
        Self::between(reference, &now.baseline(), now.count(), sign)
    }

    /// From `reference` to what was seen in so many `scans`; `sign` as in [`Moves::against`].
    #[must_use]
    pub fn between(reference: &[TaxelBaseline], now: &[TaxelBaseline], scans: u64, sign: &[i8]) -> Self {
        let mut comparable = 0;
        let short = scans < LIFE_SCANS;
        let mut moved = vec![f64::NAN; now.len()];
        for (((moved, now), reference), &sign) in moved.iter_mut().zip(now).zip(reference).zip(sign) {
            if sign == 0 || !reference.mean.is_finite() {
                continue;
            }
            comparable += 1;
            let lifeless = !short && now.noise == 0.0 && reference.noise >= LIFE_COUNTS;
            if !lifeless {
                *moved = f64::from(sign.signum()) * (now.mean - reference.mean);
            }
        }
        Self::of(moved, comparable)
    }

    /// Nothing to compare with: every taxel with a value takes part and has not moved.
    #[must_use]
    pub fn unsigned(now: &[TaxelBaseline]) -> Self {
        let moved: Vec<f64> = now.iter().map(|t| if t.mean.is_finite() { 0.0 } else { f64::NAN }).collect();
        let comparable = moved.len();
        Self::of(moved, comparable)
    }

    fn of(moved: Vec<f64>, comparable: usize) -> Self {
        let sound = moved.iter().filter(|m| m.is_finite()).count();
        Self { moved, sound, comparable }
    }

    /// The same moves, away from load.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { moved: self.moved.iter().map(|m| -m).collect(), ..*self }
    }

    /// Taxels that take part, and those that have a reference.
    #[must_use]
    pub const fn counts(&self) -> (usize, usize) {
        (self.sound, self.comparable)
    }

    /// Whether at least this share of the taxels with a reference takes part.
    #[must_use]
    pub fn are_enough(&self, sound_share_min: f64) -> bool {
        self.sound > 0 && self.sound as f64 >= sound_share_min * self.comparable as f64
    }

    /// Whether enough taxels of a module take part to speak for it.
    pub(super) fn are_enough_of(&self, module: &Range<usize>) -> bool {
        let taxels = self.moved.get(module.clone()).unwrap_or_default();
        let least = if taxels.len() < MODULE_TAXELS_MIN { taxels.len().div_ceil(2) } else { MODULE_TAXELS_MIN };
        taxels.iter().filter(|m| m.is_finite()).count() >= least.max(1)
    }

    /// Whether a taxel takes part.
    pub(super) fn has(&self, taxel: usize) -> bool {
        self.moved[taxel].is_finite()
    }

    /// The taxels that take part.
    pub fn taxels(&self) -> impl Iterator<Item = usize> {
        self.moved.iter().enumerate().filter(|(_, m)| m.is_finite()).map(|(taxel, _)| taxel)
    }

    /// The move of the median taxel; NaN of none.
    #[must_use]
    pub fn median(&self) -> f64 {
        median(self.moved.iter().copied()).unwrap_or(f64::NAN)
    }

    /// The module whose median taxel moved furthest beyond `all`, and how far; `(None, 0.0)` if none did.
    #[must_use]
    pub fn worst_module(&self, modules: &[Range<usize>], all: f64) -> (Option<usize>, f64) {
        self.worst(modules, all, |moved| median(moved.iter().copied()))
    }

    /// The module whose third taxel moved furthest beyond `all`, and how far; `(None, 0.0)` if none did.
    #[must_use]
    pub fn worst_third(&self, modules: &[Range<usize>], all: f64) -> (Option<usize>, f64) {
        self.worst(modules, all, third)
    }

    /// The module whose second taxel moved furthest beyond `all`, and how far; `(None, 0.0)` if none did.
    #[must_use]
    pub fn worst_second(&self, modules: &[Range<usize>], all: f64) -> (Option<usize>, f64) {
        self.worst(modules, all, |moved| greatest(moved, 1))
    }

    fn worst(&self, modules: &[Range<usize>], all: f64, of: impl Fn(&[f64]) -> Option<f64>) -> (Option<usize>, f64) {
        let mut worst = (None, 0.0);
        for (module, range) in modules.iter().enumerate() {
            if !self.are_enough_of(range) {
                continue;
            }
            let beyond = of(&self.moved[range.clone()]).unwrap_or(0.0) - all;
            if beyond > worst.1 {
                worst = (Some(module), beyond);
            }
        }
        worst
    }
}

/// The third greatest of the finite values; `None` of fewer.
#[must_use]
pub fn third(values: &[f64]) -> Option<f64> {
    greatest(values, 2)
}

/// The finite value that so many others are greater than.
fn greatest(values: &[f64], greater: usize) -> Option<f64> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    finite.sort_by(|a, b| b.total_cmp(a));
    finite.get(greater).copied()
}
