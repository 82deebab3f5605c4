//! What is known of the zeros that the boards take when they are configured: they keep them, also while the daemon is away.

use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize};

use crate::baseline::TaxelBaseline;
use crate::statistics::{MEDIAN_DEVIATIONS, mean, median};

/// A mean lies this many of its standard deviations from zero before it counts as more than chance: so far one of 23 modules
/// comes in one of 700 starts if noise is normal and independent; three in sixty did on the simulator's forearm.
const CHANCE_SIGMAS: f64 = 4.0;

/// The taxels of a skin lie at least so far apart, counts: what a mean of twenty readings is rounded to.
const APART_MIN_COUNTS: f64 = 0.1;

/// What is known of the zeros of the boards of a patch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoardZeros {
    /// Why the counts cannot show whether the skin is at rest, if that is so: a board took a zero of its own under a load, or
    /// nobody saw what lay on it.
    pub unproven: Option<String>,
    /// The model set for which that does not count: it was made in a session on the boards as they are.
    pub excused: Option<String>,
    /// What they hide. `None` where nobody looked yet, or somebody vouched for the skin when they were configured.
    pub hidden: Option<Arc<HiddenCounts>>,
}

/// What the zeros of the boards hide: a load that a look let pass, and where the temperature was.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HiddenCounts {
    /// By how many counts each taxel lay from the rest of the models when the boards took their zeros, one per taxel; 0 where
    /// nothing is known.
    #[serde(deserialize_with = "with_gaps")]
    pub counts: Vec<f32>,
    /// What each taxel read right then, with these zeros, or with those before as long as nobody knows; NaN where it was not
    /// read, empty before anybody knew. What it read with the zeros before is no substitute: a board draws counts anew.
    #[serde(deserialize_with = "with_gaps")]
    pub reads: Vec<f32>,
}

/// JSON has `null` for a number that is none.
fn with_gaps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f32>, D::Error> {
    let numbers = Vec::<Option<f32>>::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f32::NAN)).collect())
}

impl HiddenCounts {
    /// Boards are configured on a skin that reads `looked` before, under zeros that hide `earlier`. `models` is the rest of the
    /// models.
    ///
    /// The first time all counts by which it lies from that, also what the boards drew when they took the zeros that they
    /// had: nobody can tell it from a load. Later what has changed beyond chance since they took them.
    pub(super) fn of(
        looked: &[TaxelBaseline],
        models: &[TaxelBaseline],
        earlier: Option<&Self>,
        modules: &[Range<usize>],
    ) -> Self {
        let Some(earlier) = earlier else {
            return Self { counts: away(looked, &means(models)), reads: Vec::new() };
        };
        let mut counts = earlier.counts.clone();
        let changed = beyond_chance(&away(looked, &earlier.reads), modules, true);
        counts.iter_mut().zip(changed).for_each(|(counts, changed)| *counts += changed);
        Self { counts, reads: earlier.reads.clone() }
    }

    /// The boards have been configured, and the taxels read `first`. What lies beyond chance from what they read with the zeros
    /// before, on a module more than on all, came to lie there meanwhile; all else is what the boards drew.
    pub(super) fn settled(&self, first: &[TaxelBaseline], modules: &[Range<usize>]) -> Self {
        let mut reads = means(first);
        let came = beyond_chance(&away(first, &self.reads), modules, false);
        reads.iter_mut().zip(came).for_each(|(reads, came)| *reads -= came);
        Self { counts: self.counts.clone(), reads }
    }

    /// The skin is at rest for other models, too, while it reads `rest`: of each taxel what is more towards load counts, that
    /// for the earlier ones or that for these.
    pub(super) fn for_models_at(&self, rest: &[TaxelBaseline], signs: &[i8]) -> Self {
        let mut counts = self.counts.clone();
        let for_these = away(rest, &self.reads).into_iter().map(|away| -away);
        for ((counts, these), sign) in counts.iter_mut().zip(for_these).zip(signs) {
            if (these - *counts) * f32::from(*sign) > 0.0 {
                *counts = these;
            }
        }
        Self { counts, reads: self.reads.clone() }
    }
}

fn means(taxels: &[TaxelBaseline]) -> Vec<f32> {
    taxels.iter().map(|taxel| taxel.mean as f32).collect()
}

/// How far each taxel is from what it reads otherwise, counts; 0 if one of these is not known.
fn away(now: &[TaxelBaseline], otherwise: &[f32]) -> Vec<f32> {
    let away = now.iter().zip(otherwise).map(|(now, otherwise)| now.mean as f32 - otherwise);
    away.map(|counts| if counts.is_finite() { counts } else { 0.0 }).collect()
}

/// What of this a load or the temperature may be, and not only noise or what boards draw when they take a zero, which have no
/// direction and would add up with each start. A load moves all of a module, the temperature all of the skin.
///
/// With `d` the standard deviation of the taxels, from their median deviation: a module counts if its mean lies by
/// [`CHANCE_SIGMAS`] times `d / sqrt(n)` from the median of the skin, and that itself, if it is `of_all`, where it lies so far
/// from 0.
fn beyond_chance(counts: &[f32], modules: &[Range<usize>], of_all: bool) -> Vec<f32> {
    let middle = median(counts.iter().map(|counts| f64::from(*counts))).unwrap_or(0.0);
    let apart = counts.iter().map(|counts| (f64::from(*counts) - middle).abs());
    let deviation = (MEDIAN_DEVIATIONS * median(apart).unwrap_or(0.0)).max(APART_MIN_COUNTS);
    let is_more = |mean: f64, taxels: usize| mean.abs() > CHANCE_SIGMAS * deviation / (taxels as f64).sqrt();
    let common = if of_all && is_more(middle, counts.len()) { middle } else { 0.0 };
    let beside = if of_all { 0.0 } else { middle as f32 };
    let mut kept = vec![common as f32; counts.len()];
    for module in modules {
        let Some(own) = counts.get(module.clone()) else { continue };
        let (mean, taxels) = mean(own.iter().map(|counts| f64::from(*counts)));
        if is_more(mean - middle, taxels) {
            kept[module.clone()].iter_mut().zip(own).for_each(|(kept, own)| *kept = own - beside);
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
        let with_drawn =
            |counts: fn(usize) -> f32| -> Vec<f32> { (0..TAXELS).map(|taxel| counts(taxel) + drawn(taxel)).collect() };
        let kept = |counts| beyond_chance(&with_drawn(counts), &modules(), true);
        assert_eq!(kept(|_| 0.0), [0.0; TAXELS]);
        // A module is kept as it is; the mean of ten is chance up to 0.47.
        let on_one = kept(|taxel| if taxel / 10 == 2 { -0.5 } else { 0.0 });
        assert_eq!(on_one[20..25], [-1.0, -0.75, -0.5, -0.25, 0.0]);
        assert_eq!((&on_one[..20], &on_one[30..]), (&[0.0; 20][..], &[0.0; 70][..]));
        assert_eq!(kept(|taxel| if taxel / 10 == 2 { -0.4375 } else { 0.0 }), [0.0; TAXELS]);
        // Of all what they have in common: the median of a hundred is chance up to 0.15.
        assert_eq!(kept(|_| 0.1875), [0.1875; TAXELS]);
        assert_eq!(kept(|_| 0.125), [0.0; TAXELS]);
        let warm_and_one_beside = |taxel| if taxel / 10 == 2 { 3.0 } else { 1.0 };
        let kept = kept(warm_and_one_beside);
        assert_eq!((kept[20], kept[24], kept[30]), (2.5, 3.5, 1.0));
        // Without what they have in common.
        let kept = beyond_chance(&with_drawn(warm_and_one_beside), &modules(), false);
        assert_eq!((kept[20], kept[24], kept[30]), (1.5, 2.5, 0.0));
        // Taxels that agree to the last bit are no closer than a tenth of a count: a module is chance up to 0.126.
        let on_one = |counts: f32| (0..TAXELS).map(|taxel| if taxel < 10 { counts } else { 0.0 }).collect::<Vec<f32>>();
        assert_eq!(beyond_chance(&on_one(0.125), &modules(), true), [0.0; TAXELS]);
        assert_eq!(beyond_chance(&on_one(0.1275), &modules(), true)[0], 0.1275);
    }

    #[test]
    fn what_boards_draw_does_not_add_up_and_a_load_that_comes_between_does() {
        // The models' rest is beside what boards read that were just configured: on all taxels, and on one module more.
        let models = at(|taxel| if taxel / 10 == 7 { 3.0 } else { 1.0 });
        let first = HiddenCounts::of(&at(|taxel| drawn(taxel) - 1.0), &models, None, &modules());
        assert_eq!(first.counts[..5], [-2.5, -2.25, -2.0, -1.75, -1.5]);
        assert_eq!((first.counts[70], first.reads.len()), (-4.5, 0));
        // Nobody knows what they read, so nothing has changed.
        assert_eq!(HiddenCounts::of(&at(drawn), &models, Some(&first), &modules()), first);
        // The boards draw anew, nothing comes, and the next looks find what they drew, however often.
        let mut known = first.settled(&at(|taxel| -drawn(taxel)), &modules());
        assert_eq!((&known.counts, known.reads[0]), (&first.counts, 240.5));
        for start in 0..6 {
            let (before, now) = if start % 2 == 0 { (-1.0, 1.0) } else { (1.0, -1.0) };
            let looked = at(|taxel| before * drawn(taxel) + 0.001 * drawn(taxel + 1));
            assert_eq!(HiddenCounts::of(&looked, &models, Some(&known), &modules()), known, "start {start}");
            known = known.settled(&at(|taxel| now * drawn(taxel)), &modules());
            assert_eq!((&known.counts, known.reads[0]), (&first.counts, 240.0 + now * drawn(0)));
        }
        // A module takes a load, the boards are configured, it takes another, and both are known at the next look.
        let on_one = |counts: f32| at(move |taxel| if taxel / 10 == 3 { counts } else { 0.0 } - drawn(taxel));
        let next = HiddenCounts::of(&on_one(-1.0), &models, Some(&known), &modules());
        assert_eq!((next.counts[29], next.counts[30]), (first.counts[29], first.counts[30] - 1.0));
        let next = HiddenCounts::of(&on_one(-2.0), &models, Some(&next.settled(&on_one(-2.0), &modules())), &modules());
        assert_eq!((next.counts[29], next.counts[30]), (first.counts[29], first.counts[30] - 3.0));
    }

    #[test]
    fn of_a_taxel_that_was_not_read_what_was_known_stays() {
        let models = at(|_| 0.0);
        let unread = at(|taxel| if taxel == 0 { f32::NAN } else { -2.0 });
        let first = HiddenCounts::of(&unread, &models, None, &modules());
        assert_eq!(first.counts[..2], [0.0, -2.0]);
        let known = first.settled(&unread, &modules());
        assert!(known.reads[0].is_nan() && known.reads[1] == 238.0);
        let next = HiddenCounts::of(&at(|_| -3.0), &models, Some(&known), &modules());
        assert_eq!((next.counts[1], next.counts[99]), (-3.0, -3.0));
        let unknown = at(|taxel| if taxel == 0 { f32::NAN } else { 0.0 });
        assert_eq!(HiddenCounts::of(&at(|_| -2.0), &unknown, None, &modules()).counts[..2], [0.0, -2.0]);
    }

    #[test]
    fn models_of_the_skin_as_it_is_hide_no_less_than_others() {
        let read = |means: [f64; 4]| means.map(|mean| TaxelBaseline { mean, noise: 0.5 });
        let known = HiddenCounts { counts: vec![-1.5, 2.0, -0.25, 1.0], reads: vec![240.0; 4] };
        // Models whose rest the skin reads at 241 lie a count towards load at 240, where pressure lowers the counts.
        let rest = read([241.0, 241.0, f64::NAN, 239.0]);
        let for_both = known.for_models_at(&rest, &[-1, -1, -1, 1]);
        assert_eq!(for_both, HiddenCounts { counts: vec![-1.5, -1.0, -0.25, 1.0], reads: known.reads.clone() });
        let unsettled = HiddenCounts { reads: Vec::new(), ..known };
        assert_eq!(unsettled.for_models_at(&rest, &[-1; 4]), unsettled);
    }
}
