//! What moved a little on many modules at once.
//!
//! A light load that comes over a wide part of a skin moves each module by less than its own noise explains. All modules
//! together tell: at rest their mean moves from half to half of a watch scatter about the skin's median as their standard
//! errors say, and the sum of their squares has a chi-square distribution.

use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;

use super::moves::Moves;
use super::statistics::{NOISE_FLOOR_COUNTS, RestWindow};
use crate::baseline::TaxelBaseline;
use crate::statistics::median;

/// Most of [`unlikeness()`] at rest: of normal noise once in 1,000 windows by chance.
pub const UNLIKENESS_MAX: f64 = 3.1;

/// A taxel counts with so many standard errors at most: one that is broken does not speak for its module.
const TAXEL_ERRORS_MAX: f64 = 3.0;

/// How unlike each other the modules of a skin moved from half to half of a watch, as a standard normal deviate; `None` where
/// fewer than two modules can be read, or a half has a single scan.
///
/// A taxel's noise is what its model knows, or without `models` that of both halves: the quieter one alone would make every
/// skin seem to move.
#[must_use]
pub fn unlikeness(window: &RestWindow, models: Option<&[TaxelBaseline]>, moves: &Moves) -> Option<f64> {
    if !window.has_both_halves() {
        return None;
    }
    let share = window.halves_error();
    let [before, after] = window.halves().each_ref().map(|half| half.baseline());
    let errors = |taxel: usize| {
        let own = || before[taxel].noise.hypot(after[taxel].noise) * FRAC_1_SQRT_2;
        let noise = models.map_or_else(own, |models| models[taxel].noise);
        let least = if noise.is_finite() { noise.max(NOISE_FLOOR_COUNTS) } else { f64::NAN };
        (after[taxel].mean - before[taxel].mean) / (least * share)
    };
    let of_module = |range: &Range<usize>| -> Vec<f64> {
        range.clone().filter(|&taxel| moves.has(taxel)).map(errors).filter(|errors| errors.is_finite()).collect()
    };
    let modules = window.all().modules().iter().filter(|range| moves.are_enough_of(range));
    deviate(&modules.map(of_module).collect::<Vec<_>>())
}

/// How unlike each other modules moved, as a standard normal deviate; `None` of fewer than two modules.
///
/// `modules` has for each of them how far its taxels moved, in standard errors of theirs. What the median taxel of all moved
/// by is taken off first: warmth moves all taxels. The deviate is that of a chi-square with one degree of freedom less than
/// there are modules (Wilson and Hilferty, The Distribution of Chi-Square, 1931).
fn deviate(modules: &[Vec<f64>]) -> Option<f64> {
    let common = median(modules.iter().flatten().copied())?;
    let freedom = modules.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let errors = |taxels: &Vec<f64>| {
        let clipped = taxels.iter().map(|moved| (moved - common).clamp(-TAXEL_ERRORS_MAX, TAXEL_ERRORS_MAX));
        clipped.sum::<f64>() / (taxels.len().max(1) as f64).sqrt()
    };
    let chi_square: f64 = modules.iter().map(|taxels| errors(taxels).powi(2)).sum();
    let variance = 2.0 / (9.0 * freedom);
    Some(((chi_square / freedom).cbrt() - (1.0 - variance)) / variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::tests::Noise;
    use super::*;

    /// So many modules of ten taxels with errors of their own, and what each module moves by beside.
    fn modules(noise: &mut Noise, count: usize, moved: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
        (0..count).map(|module| (0..10).map(|_| noise.normal() + moved(module)).collect()).collect()
    }

    fn refused(count: usize, moved: impl Fn(usize) -> f64) -> usize {
        let mut noise = Noise(31);
        let windows = (0..10_000).map(|_| deviate(&modules(&mut noise, count, &moved)).unwrap());
        windows.filter(|unlike| *unlike > UNLIKENESS_MAX).count()
    }

    #[test]
    fn chance_refuses_one_rest_in_a_thousand_whatever_moves_all() {
        for (modules, common) in [(2, 0.0), (5, 0.0), (23, 0.0), (23, 40.0)] {
            let refused = refused(modules, |_| common);
            assert!((1..=30).contains(&refused), "{modules} modules: {refused} of 10,000");
        }
    }

    #[test]
    fn five_modules_of_23_that_move_by_less_than_a_module_may_are_seen() {
        // A module's median may move by 4 of its standard errors and half a count, the mean of these moves by 3.
        let moved = 3.0 / 10f64.sqrt();
        let refused = refused(23, |module| if module < 5 { moved } else { 0.0 });
        assert!(refused > 6_000, "{refused} of 10,000");
    }

    #[test]
    fn a_broken_taxel_is_no_spread_load_and_one_module_alone_has_nothing_to_be_unlike() {
        let mut noise = Noise(32);
        let mut of_five = modules(&mut noise, 5, |_| 0.0);
        let before = deviate(&of_five).unwrap();
        of_five[2][0] = 1e6;
        let after = deviate(&of_five).unwrap();
        assert!(after < UNLIKENESS_MAX && (after - before).abs() < 2.0, "{before} to {after}");
        assert_eq!(deviate(&of_five[..1]), None);
        assert_eq!(deviate(&[]), None);
        assert_eq!(deviate(&[vec![], vec![]]), None);
    }
}
