//! What is known of the zeros that the boards take when they are configured: they keep them, also while the daemon is away.

use std::ops::Range;
use std::sync::Arc;

use crate::baseline::TaxelBaseline;
use crate::statistics::{mean, median};

/// The standard deviation of normal errors over their median absolute deviation.
const DEVIATIONS: f64 = 1.4826;

/// A mean lies this many of its standard deviations from zero before it counts as more than chance: so far one of 23 modules
/// comes by chance in one of 700 starts.
const CHANCE_SIGMAS: f64 = 4.0;

/// What is known of the zeros of the boards of a patch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardZeros {
    /// Why the counts cannot show whether the skin is at rest, if that is so: a board took a zero of its own under a load, or
    /// nobody saw what lay on it.
    pub unproven: Option<String>,
    /// What they hide. `None` where nobody looked, or somebody vouched for the skin.
    pub hidden: Option<Arc<HiddenCounts>>,
}

impl BoardZeros {
    /// Whether nothing is known.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.unproven.is_none() && self.hidden.is_none()
    }
}

/// What the zeros of the boards hide: a load that a look let pass, and where the temperature was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HiddenCounts {
    /// By how many counts each taxel lay from the rest of the models when the boards took their zeros; 0 where nothing is known.
    pub counts: Vec<f32>,
    /// What each taxel read then, with these zeros: NaN where nothing is known, empty until a zero was taken.
    pub reads: Vec<f32>,
}

impl HiddenCounts {
    /// Boards are configured on a skin that reads `looked` before, under zeros that hide `earlier`. `models` is the rest of the
    /// models.
    ///
    /// Where it is known what the taxels read under these, only what has changed beyond chance since counts. Where not, what
    /// the boards drew when they took them counts, too: nobody can tell it from a load.
    pub(super) fn of(
        looked: &[TaxelBaseline],
        models: &[TaxelBaseline],
        earlier: Option<&Self>,
        modules: &[Range<usize>],
    ) -> Self {
        let reads = earlier.map_or(&[][..], |earlier| &earlier.reads);
        let seen = if reads.is_empty() {
            away(looked, models.iter().map(|taxel| taxel.mean as f32))
        } else {
            beyond_chance(&away(looked, reads.iter().copied()), modules)
        };
        let before = |taxel: usize| earlier.and_then(|earlier| earlier.counts.get(taxel)).copied().unwrap_or(0.0);
        let counts = seen.into_iter().enumerate().map(|(taxel, seen)| seen + before(taxel)).collect();
        Self { counts, reads: Vec::new() }
    }

    /// The first zero since then is taken. What lies beyond chance from the rest of the models came after the boards took
    /// their zeros; all else is what these drew.
    pub(super) fn at(&self, zero: &[TaxelBaseline], models: &[TaxelBaseline], modules: &[Range<usize>]) -> Self {
        let came = beyond_chance(&away(zero, models.iter().map(|taxel| taxel.mean as f32)), modules);
        let came = came.into_iter().chain(std::iter::repeat(0.0));
        Self {
            counts: self.counts.iter().zip(came).map(|(before, came)| before + came).collect(),
            reads: zero.iter().map(|taxel| taxel.mean as f32).collect(),
        }
    }
}

/// How far each taxel is from what it reads otherwise, counts; 0 if one of these is not known.
fn away(now: &[TaxelBaseline], otherwise: impl Iterator<Item = f32>) -> Vec<f32> {
    let away = now.iter().zip(otherwise).map(|(now, otherwise)| now.mean as f32 - otherwise);
    away.map(|counts| if counts.is_finite() { counts } else { 0.0 }).collect()
}

/// What of this a load or the temperature may be, and not only noise or what boards draw when they take a zero, which have no
/// direction and would add up with each start. A load moves all of a module, the temperature all of the skin.
///
/// With `d` the standard deviation of the taxels, from their median deviation: the median of the skin counts if it lies by
/// [`CHANCE_SIGMAS`] times `d / sqrt(n)` from 0, a module if its mean lies so far from that.
fn beyond_chance(counts: &[f32], modules: &[Range<usize>]) -> Vec<f32> {
    let middle = median(counts.iter().map(|counts| f64::from(*counts))).unwrap_or(0.0);
    let apart = counts.iter().map(|counts| (f64::from(*counts) - middle).abs());
    let deviation = DEVIATIONS * median(apart).unwrap_or(0.0);
    let is_more = |mean: f64, taxels: usize| mean.abs() > CHANCE_SIGMAS * deviation / (taxels as f64).sqrt();
    let of_all = if is_more(middle, counts.len()) { middle } else { 0.0 };
    let mut kept = vec![of_all as f32; counts.len()];
    for module in modules {
        let Some(own) = counts.get(module.clone()) else { continue };
        let (mean, taxels) = mean(own.iter().map(|counts| f64::from(*counts)));
        if is_more(mean - middle, taxels) {
            kept[module.clone()].copy_from_slice(own);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAXELS: usize = 100;

    fn modules() -> Vec<Range<usize>> {
        (0..TAXELS / 10).map(|module| 10 * module..10 * module + 10).collect()
    }

    /// What a board draws for each taxel: up to half a count, no direction. The deviation is 0.37 counts.
    fn drawn(taxel: usize) -> f32 {
        [-0.5, -0.25, 0.0, 0.25, 0.5][taxel % 5]
    }

    fn at(counts: impl Fn(usize) -> f32) -> Vec<TaxelBaseline> {
        (0..TAXELS).map(|taxel| TaxelBaseline { mean: 240.0 + f64::from(counts(taxel)), noise: 0.5 }).collect()
    }

    #[test]
    fn what_boards_draw_is_chance_and_what_lies_on_a_module_or_on_all_is_not() {
        let kept = |counts: fn(usize) -> f32| {
            beyond_chance(&(0..TAXELS).map(|taxel| counts(taxel) + drawn(taxel)).collect::<Vec<f32>>(), &modules())
        };
        assert_eq!(kept(|_| 0.0), [0.0; TAXELS]);
        // A module is kept as it is; the mean of ten is chance up to 0.47.
        let on_one = kept(|taxel| if taxel / 10 == 2 { -0.5 } else { 0.0 });
        assert_eq!(on_one[20..25], [-1.0, -0.75, -0.5, -0.25, 0.0]);
        assert_eq!((&on_one[..20], &on_one[30..]), (&[0.0; 20][..], &[0.0; 70][..]));
        assert_eq!(kept(|taxel| if taxel / 10 == 2 { -0.4375 } else { 0.0 }), [0.0; TAXELS]);
        // Of all what they have in common: the median of a hundred is chance up to 0.15.
        assert_eq!(kept(|_| 0.1875), [0.1875; TAXELS]);
        assert_eq!(kept(|_| 0.125), [0.0; TAXELS]);
        let warm_and_one_beside = kept(|taxel| if taxel / 10 == 2 { 3.0 } else { 1.0 });
        assert_eq!((warm_and_one_beside[20], warm_and_one_beside[24], warm_and_one_beside[30]), (2.5, 3.5, 1.0));
    }

    #[test]
    fn what_boards_draw_does_not_add_up_and_a_load_that_comes_between_does() {
        let models = at(|_| 0.0);
        let first = HiddenCounts::of(&at(|taxel| drawn(taxel) - 1.0), &models, None, &modules());
        assert_eq!(first.counts[..5], [-1.5, -1.25, -1.0, -0.75, -0.5]);
        // The boards draw anew, nothing has come, and the next look finds the same.
        let known = first.at(&at(|taxel| -drawn(taxel)), &models, &modules());
        assert_eq!((&known.counts, known.reads[0]), (&first.counts, 240.5));
        let second =
            HiddenCounts::of(&at(|taxel| 0.001 * drawn(taxel + 1) - drawn(taxel)), &models, Some(&known), &modules());
        assert_eq!(second, first);
        // Something comes to lie on a module after the boards took their zeros, and before the zero.
        let came = |taxel: usize| if taxel / 10 == 3 { -1.0 } else { 0.0 };
        let known = first.at(&at(|taxel| came(taxel) - drawn(taxel)), &models, &modules());
        assert_eq!((known.counts[0], known.counts[30], known.counts[32]), (-1.5, -2.0, -2.0));
        // It is taken away, and the next look sees that.
        let third = HiddenCounts::of(&at(|taxel| -drawn(taxel)), &models, Some(&known), &modules());
        assert_eq!((third.counts[0], third.counts[32]), (-1.5, -1.0));
    }

    #[test]
    fn of_a_taxel_that_was_not_read_what_was_known_stays() {
        let models = at(|_| 0.0);
        let unread = at(|taxel| if taxel == 0 { f32::NAN } else { -2.0 });
        let earlier = HiddenCounts { counts: vec![-1.5; TAXELS], reads: Vec::new() };
        let found = HiddenCounts::of(&unread, &models, Some(&earlier), &modules());
        assert_eq!(found.counts[..2], [-1.5, -3.5]);
        let known = found.at(&unread, &models, &modules());
        assert!(known.reads[0].is_nan() && known.reads[1] == 238.0);
        assert_eq!(known.counts[1], -5.5, "all of the skin has moved");
        assert_eq!(HiddenCounts::of(&at(|_| -2.0), &models, Some(&known), &modules()).counts, known.counts);
    }
}
