//! What counts are compared with: the zero, the way pressure moves them, how far a touch is, and how far the zero lies from that of
//! the models.

use taxel_skin::ModuleKind;

use crate::baseline::{Activation, TaxelBaseline};
use crate::model_set::ModelSet;
use crate::regions::Regions;
use crate::statistics::median;

/// More than this is no creep of earlier loads but another zero of the boards, or the temperature; counts.
const RESIDUE_MAX_COUNTS: f64 = 2.0;

/// What counts are compared with, all per taxel. Without a zero it is the last one, or that of the models.
#[derive(Clone, Debug)]
pub struct Ground {
    zero: Vec<TaxelBaseline>,
    /// Which way pressure moves the count: +1, -1, or 0 where that is not known.
    signs: Vec<i8>,
    /// Counts from the zero from which on a taxel is touched.
    touched_counts: Vec<f64>,
    /// The zero of the models.
    models: Vec<TaxelBaseline>,
    /// How far the zero was taken towards load from that.
    residue_counts: f64,
}

impl Ground {
    /// Nothing is known but that pressure lowers the counts of all boards of iCub. Of other sensors only models tell.
    pub fn new(regions: &Regions) -> Self {
        let sign = |kind: &ModuleKind| if matches!(kind, ModuleKind::Cells(_)) { 0 } else { -1 };
        let modules = regions.modules().iter().zip(regions.kinds());
        let signs = modules.flat_map(|(taxels, kind)| taxels.clone().map(move |_| sign(kind))).collect();
        let (zero, models, touched_counts) = (Vec::new(), Vec::new(), vec![0.0; regions.taxels()]);
        Self { zero, signs, touched_counts, models, residue_counts: 0.0 }
    }

    /// A zero was taken.
    pub fn take(&mut self, zero: &[TaxelBaseline]) {
        self.touched_counts = zero.iter().map(|taxel| Activation::OF_SKIN.distance_counts(taxel.noise)).collect();
        self.residue_counts = residue_counts(&self.models, zero, &self.signs);
        self.follow(zero.to_vec());
    }

    /// The zero moved with the temperature.
    pub fn follow(&mut self, zero: Vec<TaxelBaseline>) {
        self.zero = zero;
    }

    /// Other models are in use. The zero is `taken`; without one, loads are judged from the models'.
    pub fn set_models(&mut self, set: &ModelSet, taken: Option<&[TaxelBaseline]>) {
        (self.signs, self.models) = (set.signs(), set.baseline.clone());
        match taken {
            Some(taken) => self.residue_counts = residue_counts(&self.models, taken, &self.signs),
            None => self.take(&set.baseline),
        }
    }

    /// One per taxel; none before the first zero or models.
    pub fn zero(&self) -> &[TaxelBaseline] {
        &self.zero
    }

    /// One per taxel: +1, -1, or 0 where it is not known.
    pub fn signs(&self) -> &[i8] {
        &self.signs
    }

    /// Counts from the zero from which on the taxel is touched.
    pub fn touched_counts(&self, taxel: usize) -> f64 {
        self.touched_counts.get(taxel).copied().unwrap_or(f64::MAX)
    }

    /// How far the zero lies towards load from that of the models, counts, from 0 to [`RESIDUE_MAX_COUNTS`], once it has followed
    /// the skin by so many counts towards load: what the skin remembers of earlier loads. How it creeps back is the offset's.
    pub fn residue_counts(&self, followed: f64) -> f64 {
        (self.residue_counts + followed.min(0.0)).max(0.0)
    }
}

/// How far the median taxel of `zero` lies towards load from that of the `models`, 0 to [`RESIDUE_MAX_COUNTS`]; 0 where
/// nothing can be compared. `signs` say which way pressure moves the counts.
fn residue_counts(models: &[TaxelBaseline], zero: &[TaxelBaseline], signs: &[i8]) -> f64 {
    let with_sign = zero.iter().zip(models).zip(signs).filter(|(_, sign)| **sign != 0);
    let moved = with_sign.map(|((zero, models), sign)| f64::from(*sign) * (zero.mean - models.mean));
    median(moved).map_or(0.0, |moved| moved.clamp(0.0, RESIDUE_MAX_COUNTS))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zero(mean: f64) -> Vec<TaxelBaseline> {
        vec![TaxelBaseline { mean, noise: 0.8 }; 20]
    }

    #[test]
    fn a_residue_is_what_the_zero_lies_towards_load_and_no_more_than_a_skin_remembers() {
        let residue = |now: f64| residue_counts(&zero(240.0), &zero(now), &[-1; 20]);
        assert!((residue(239.2) - 0.8).abs() < 1e-9);
        assert_eq!([residue(240.5), residue(230.0), residue(f64::NAN)], [0.0, RESIDUE_MAX_COUNTS, 0.0]);
    }
}
