//! What a skin that was pressed still shows when it is at rest again, and how it recovers.

use crate::baseline::TaxelBaseline;
use crate::zero::rest::moves::Moves;

/// More than this is no remainder of earlier loads but another zero of the boards, or the temperature; counts.
const RESIDUE_MAX_COUNTS: f64 = 2.0;
/// Of a memory, so much is followed; more of it means that a load has gone, counts.
const RECOVERY_MAX_COUNTS: f64 = 1.5;
/// Less is noise of the median, counts.
const RECOVERY_MIN_COUNTS: f64 = 0.05;
/// Longest time constants of a skin's creep are some minutes; what moves the counts later is something else.
const RECOVERY_SECONDS: f64 = 600.0;

/// What the skin remembers of loads before the zero was taken, and has recovered since.
///
/// The skin as a whole becomes lighter after a zero that was taken soon after a load: it creeps back to its rest. Nothing
/// that presses moves counts that way, so the zero may follow; never back, which could hide a load.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// The zero of the models.
    models: Vec<TaxelBaseline>,
    /// How far the zero was taken towards load from that.
    residue_counts: f64,
    /// How far the zero has followed the skin since, away from load.
    recovered_counts: f64,
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
        self.recovered_counts = 0.0;
    }

    /// How far the zero lies towards load from that of the models, counts: from 0 to [`RESIDUE_MAX_COUNTS`].
    #[must_use]
    pub fn residue_counts(&self) -> f64 {
        (self.residue_counts - self.recovered_counts).max(0.0)
    }

    /// The median taxel has moved by so many counts towards load since, `seconds` after the zero was taken. Returns whether
    /// the zero follows.
    pub fn follow(&mut self, median_counts: f64, seconds: f64) -> bool {
        let to = (self.recovered_counts - median_counts).min(RECOVERY_MAX_COUNTS);
        let follows = median_counts < -RECOVERY_MIN_COUNTS && to > self.recovered_counts && seconds < RECOVERY_SECONDS;
        if follows {
            self.recovered_counts = to;
        }
        follows
    }

    /// `zero` as it is now.
    #[must_use]
    pub fn applied_to(&self, zero: &[TaxelBaseline], signs: &[i8]) -> Vec<TaxelBaseline> {
        let away = |(taxel, &sign): (&TaxelBaseline, &i8)| TaxelBaseline {
            mean: taxel.mean - f64::from(sign) * self.recovered_counts,
            ..*taxel
        };
        zero.iter().zip(signs).map(away).collect()
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

    #[test]
    fn a_zero_follows_a_skin_that_becomes_lighter_and_never_back() {
        let mut memory = Memory::default();
        assert!(memory.follow(-0.4, 10.0));
        assert!(!memory.follow(0.4, 12.0), "that may be a load");
        assert!(memory.follow(-0.2, 14.0));
        assert!((memory.recovered_counts - 0.6).abs() < 1e-12);
        let now = memory.applied_to(&zero(239.0), &[-1; 20]);
        assert!((now[0].mean - 239.6).abs() < 1e-12, "lighter is more counts where pressure lowers them");
        assert!(!memory.follow(-0.5, 700.0), "ten minutes later it is something else");
        assert!(!memory.follow(-0.04, 100.0) && !memory.follow(0.06, 100.0), "noise");
        assert!(memory.follow(-20.0, 100.0) && memory.recovered_counts == RECOVERY_MAX_COUNTS);
        assert!(!memory.follow(-20.0, 100.0), "it has followed as far as it may");
    }
}
