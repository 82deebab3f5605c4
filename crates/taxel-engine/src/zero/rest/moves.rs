//! How far each taxel of a skin has moved towards load since its zero was taken.

use std::ops::Range;

use super::limits::SOUND_SHARE_MIN;
use crate::baseline::TaxelBaseline;
use crate::statistics::median;

/// Fewest taxels of a module that may speak for it; of one that has fewer in all, half of them. A module of one taxel has
/// nobody else to speak for it.
const MODULE_TAXELS_MIN: usize = 5;
/// A taxel with so much noise at rest, in counts, that reads one value for so many scans is broken, not at rest.
const LIFE_COUNTS: f64 = 0.3;
const LIFE_SCANS: u64 = 10;

/// How far each taxel moved towards load, counts; NaN for one that takes no part.
#[derive(Clone, Debug)]
pub(super) struct Moves {
    moved: Vec<f64>,
    sound: usize,
    comparable: usize,
}

impl Moves {
    /// From `reference` to what was seen in so many `scans`; `sign` is +1 where the count rises with pressure, -1 where it falls, 0
    /// where that is not known.
    pub(super) fn between(reference: &[TaxelBaseline], now: &[TaxelBaseline], scans: u64, sign: &[i8]) -> Self {
        let mut comparable = 0;
        let mut moved = vec![f64::NAN; now.len()];
        for (((moved, now), reference), &sign) in moved.iter_mut().zip(now).zip(reference).zip(sign) {
            if sign == 0 || !reference.mean.is_finite() {
                continue;
            }
            comparable += 1;
            let lifeless = scans >= LIFE_SCANS && now.noise == 0.0 && reference.noise >= LIFE_COUNTS;
            if !lifeless {
                *moved = f64::from(sign.signum()) * (now.mean - reference.mean);
            }
        }
        Self::of(moved, comparable)
    }

    /// Nothing to compare with: every taxel with a value takes part and has not moved.
    pub(super) fn unsigned(now: &[TaxelBaseline]) -> Self {
        let moved: Vec<f64> = now.iter().map(|t| if t.mean.is_finite() { 0.0 } else { f64::NAN }).collect();
        let comparable = moved.len();
        Self::of(moved, comparable)
    }

    fn of(moved: Vec<f64>, comparable: usize) -> Self {
        let sound = moved.iter().filter(|m| m.is_finite()).count();
        Self { moved, sound, comparable }
    }

    /// Taxels that take part, and those that have a reference.
    pub(super) const fn counts(&self) -> (usize, usize) {
        (self.sound, self.comparable)
    }

    /// Whether enough of the taxels with a reference take part.
    pub(super) fn are_enough(&self) -> bool {
        self.sound > 0 && self.sound as f64 >= SOUND_SHARE_MIN * self.comparable as f64
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
    pub(super) fn taxels(&self) -> impl Iterator<Item = usize> {
        (0..self.moved.len()).filter(|&taxel| self.has(taxel))
    }

    /// The move of the median taxel; NaN of none.
    pub(super) fn median(&self) -> f64 {
        median(self.moved.iter().copied()).unwrap_or(f64::NAN)
    }

    /// The module whose median taxel moved furthest beyond `all`, and how far; `(None, 0.0)` if none did.
    pub(super) fn worst_module(&self, modules: &[Range<usize>], all: f64) -> (Option<usize>, f64) {
        self.worst(modules, all, |moved| median(moved.iter().copied()))
    }

    /// The same of its taxel that moved furthest but for so many.
    pub(super) fn worst_few(&self, modules: &[Range<usize>], all: f64, others: usize) -> (Option<usize>, f64) {
        self.worst(modules, all, |moved| greatest(moved, others))
    }

    fn worst(&self, modules: &[Range<usize>], all: f64, of: impl Fn(&[f64]) -> Option<f64>) -> (Option<usize>, f64) {
        let mut worst = (None, 0.0);
        for (module, range) in modules.iter().enumerate().filter(|(_, range)| self.are_enough_of(range)) {
            let beyond = of(&self.moved[range.clone()]).unwrap_or(0.0) - all;
            if beyond > worst.1 {
                worst = (Some(module), beyond);
            }
        }
        worst
    }
}

/// The finite value that so many others are greater than.
pub(super) fn greatest(values: &[f64], greater: usize) -> Option<f64> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    finite.sort_by(|a, b| b.total_cmp(a));
    finite.get(greater).copied()
}
