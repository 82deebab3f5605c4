//! What counts are compared with: the zero, the way pressure moves them, and how far a touch is.

use taxel_skin::ModuleKind;

use crate::baseline::{Activation, TaxelBaseline};
use crate::regions::Regions;

/// What counts are compared with, all per taxel. Without a zero it is the last one, or that of the models.
#[derive(Clone, Debug)]
pub struct Ground {
    zero: Vec<TaxelBaseline>,
    /// Which way pressure moves the count: +1, -1, or 0 where that is not known.
    signs: Vec<i8>,
    /// Counts from the zero from which on a taxel is touched.
    touched_counts: Vec<f64>,
    activation: Activation,
}

impl Ground {
    /// Nothing is known but that pressure lowers the counts of all boards of iCub. Of other sensors only models tell.
    #[must_use]
    pub fn new(regions: &Regions, activation: Activation) -> Self {
        let sign = |kind: &ModuleKind| if matches!(kind, ModuleKind::Cells(_)) { 0 } else { -1 };
        let modules = regions.modules().iter().zip(regions.kinds());
        let signs = modules.flat_map(|(taxels, kind)| taxels.clone().map(move |_| sign(kind))).collect();
        Self { zero: Vec::new(), signs, touched_counts: vec![0.0; regions.taxels()], activation }
    }

    /// A zero was taken.
    pub fn take(&mut self, zero: &[TaxelBaseline]) {
        self.touched_counts = zero.iter().map(|taxel| self.activation.distance_counts(taxel.noise)).collect();
        self.follow(zero.to_vec());
    }

    /// The zero moved with the temperature.
    pub fn follow(&mut self, zero: Vec<TaxelBaseline>) {
        self.zero = zero;
    }

    /// Models say which way pressure moves the counts.
    pub fn set_signs(&mut self, signs: Vec<i8>) {
        self.signs = signs;
    }

    /// One per taxel; none before the first zero or models.
    #[must_use]
    pub fn zero(&self) -> &[TaxelBaseline] {
        &self.zero
    }

    /// One per taxel: +1, -1, or 0 where it is not known.
    #[must_use]
    pub fn signs(&self) -> &[i8] {
        &self.signs
    }

    /// Counts from the zero from which on the taxel is touched.
    #[must_use]
    pub fn touched_counts(&self, taxel: usize) -> f64 {
        self.touched_counts.get(taxel).copied().unwrap_or(f64::MAX)
    }
}
