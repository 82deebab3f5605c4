//! How many counts the taxels of a module move per count of its thermal pads.

use super::limits::COEFFICIENT_MAX;

/// Least coefficient: boards that compensate too much turn the drift round.
const COEFFICIENT_MIN: f64 = -0.5;
/// The pads must have moved by so much, counts, before anything is known: their own noise and rounding is a tenth.
const PADS_MOVED_MIN: f64 = 1.5;

/// A line through the zero, by least squares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Coefficient {
    n: f64,
    pads_pads: f64,
    pads_taxels: f64,
    taxels_taxels: f64,
    pads_moved_max: f64,
}

impl Coefficient {
    /// Pads and taxels of an untouched module, counts from their zero.
    pub(super) fn learn(&mut self, pads: f64, taxels: f64) {
        self.n += 1.0;
        self.pads_pads += pads * pads;
        self.pads_taxels += pads * taxels;
        self.taxels_taxels += taxels * taxels;
        self.pads_moved_max = self.pads_moved_max.max(pads.abs());
    }

    /// Counts per count of the pads with its standard uncertainty; `None` until the pads have moved enough.
    ///
    /// Samples a second apart share nearly all of their error, so the uncertainty is that of a single one.
    pub(super) fn value(&self) -> Option<(f64, f64)> {
        if self.pads_moved_max < PADS_MOVED_MIN {
            return None;
        }
        let free = self.pads_taxels / self.pads_pads;
        let residual = (self.taxels_taxels - free * self.pads_taxels).max(0.0);
        Some((free.clamp(COEFFICIENT_MIN, COEFFICIENT_MAX), (residual / self.pads_pads).sqrt()))
    }
}
