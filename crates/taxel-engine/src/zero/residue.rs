//! What a skin that was pressed still shows when it is at rest again.

use crate::baseline::TaxelBaseline;
use crate::zero::rest::moves::Moves;

/// More than this is no remainder of earlier loads but another zero of the boards, or the temperature; counts.
const RESIDUE_MAX_COUNTS: f64 = 2.0;
/// What the skin remembers of loads before the zero was taken. How it creeps back is the offset's ([`crate::zero::offset`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// The zero of the models.
    models: Vec<TaxelBaseline>,
    /// How far the zero was taken towards load from that.
    residue_counts: f64,
}

impl Memory {
    /// Other models are in use, whose zero is `models`; `zero` is the present one, if there is one.
    pub fn on_models(&mut self, models: &[TaxelBaseline], zero: Option<&[TaxelBaseline]>, signs: &[i8]) {
        self.models = models.to_vec();
        self.residue_counts = zero.map_or(0.0, |zero| residue_counts(models, zero, signs));
    }

    /// A zero was taken.
    pub fn begin(&mut self, zero: &[TaxelBaseline], signs: &[i8]) {
        self.residue_counts = residue_counts(&self.models, zero, signs);
    }

    /// How far the zero lies towards load from that of the models, counts, from 0 to [`RESIDUE_MAX_COUNTS`], once it has
    /// followed the skin by so many counts towards load.
    #[must_use]
    pub fn residue_counts(&self, followed: f64) -> f64 {
        (self.residue_counts + followed.min(0.0)).max(0.0)
    }
}

/// How far the median taxel of `zero` lies towards load from that of the `models`, 0 to [`RESIDUE_MAX_COUNTS`]; 0 where
/// nothing can be compared. `signs` say which way pressure moves the counts.
fn residue_counts(models: &[TaxelBaseline], zero: &[TaxelBaseline], signs: &[i8]) -> f64 {
    let median = Moves::between(models, zero, 0, signs).median();
    if median.is_finite() { median.clamp(0.0, RESIDUE_MAX_COUNTS) } else { 0.0 }
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
