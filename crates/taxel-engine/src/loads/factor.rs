//! The effective-area factor: by what the areas of all taxels must be multiplied so that known loads are read right.
//!
//! With `x` the force read at the configured areas and `y` the force laid on, `y = k x` for every load. Weighted least
//! squares give
//!
//! `k = sum(w x y) / sum(w x^2)`, `w = 1 / (u_y^2 + u_x^2)`, `u^2(k) = max(1, chi^2) / sum(w x^2)`,
//!
//! where `chi^2 = sum w (y - k x)^2 / (n - 1)` widens the uncertainty where the loads agree worse than they claim
//! (Birge 1932) and never narrows it. `u_x` is the uncertainty that the samples stated, without the part of the area,
//! which is what is looked for, and with the scatter from scan to scan. It is not multiplied by k, which is near 1.
//!
//! What the areas are known to at a place where no load was laid is more than `u(k)`: no number of loads takes away that a
//! skin differs from place to place. Loads at one place count as one, P in all. With `a` the sum of `w k^2 x^2` over the
//! loads of a place, `r` the mean of `y / (k x)` there weighted by that, and `S` the sum of all `a`, the variance from place
//! to place is (DerSimonian and Laird 1986)
//!
//! `s^2 = max(0, sum(a (r - 1)^2) - (P - 1)) / (S - sum(a^2) / S)`,
//!
//! and with Student's t for P - 1 degrees of freedom and q = [`PLACE_REL`]
//!
//! `u_area^2 = (t / 2)^2 (1 / S + max(s, q)^2 sum(a^2) / S^2) + max(t / 2 s, q)^2`,
//!
//! so that twice this holds for 95 % of new places. Loads that happen to agree do not show that a skin scatters by less than
//! q. What all loads may be off by together, as one balance is, comes to it in squares.

use std::ops::RangeInclusive;

use crate::loads::load::Load;
use crate::loads::places::{LaidAt, too_few};

/// Fewer loads tell nothing of their scatter.
pub const LOADS_MIN: usize = 3;

/// A factor beyond this is no property of skin but a mistake, for example a mass in grams.
const PLAUSIBLE: RangeInclusive<f64> = 0.5..=2.0;

/// Loads that leave the factor vaguer than this disagree, and are worse than no factor.
const RELATIVE_SIGMA_MAX: f64 = 0.2;

/// No load is believed better than to this share of it, or it alone would decide.
const RELATIVE_SIGMA_MIN: f64 = 1e-3;

/// Relative standard deviation of what a sound skin reads of masses from place to place, as simulated for masses above
/// 0.36 kg on pads that read 2 to 3 kPa a count.
pub const PLACE_REL: f64 = 0.03;

/// Student's t for 95 % on both sides, for 1 and more degrees of freedom.
const STUDENT: [f64; 12] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179];

/// The effective-area factor of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaFactor {
    /// What the configured areas are multiplied by, above 0.
    pub value: f64,
    /// Its standard uncertainty.
    pub sigma: f64,
    /// How many loads it is from, 3 or more.
    pub loads: usize,
    /// At how many places of the patch they are known to have lain.
    pub places: usize,
    /// Of how many of them it is not known where they lay.
    pub unplaced: usize,
    /// Relative standard uncertainty of the areas at a place where no load was laid.
    pub area_uncertainty: f64,
}

impl AreaFactor {
    /// The factor that `loads` give; `None` if they are fewer than three.
    #[must_use]
    pub fn estimate<'a>(loads: impl IntoIterator<Item = &'a Load>) -> Option<Self> {
        let loads: Vec<&Load> = loads.into_iter().collect();
        let points: Vec<Point> = loads.iter().copied().map(Point::of).collect();
        let n = points.len();
        if n < LOADS_MIN {
            return None;
        }
        let sum = |term: &dyn Fn(&Point) -> f64| points.iter().map(term).sum::<f64>();
        let xx = sum(&|p| p.weight * p.read * p.read);
        let value = sum(&|p| p.weight * p.read * p.laid) / xx;
        let chi2 = sum(&|p| p.weight * (p.laid - value * p.read).powi(2)) / (n - 1) as f64;
        let sigma = (chi2.max(1.0) / xx).sqrt();
        let laid = LaidAt::of(&loads);
        let area_uncertainty = elsewhere(&points, value, &laid).hypot(common_rel(&loads));
        let finite = [value, sigma, area_uncertainty].into_iter().all(f64::is_finite);
        let LaidAt { known: places, unplaced, .. } = laid;
        finite.then_some(Self { value, sigma, loads: n, places, unplaced, area_uncertainty })
    }

    /// Why it cannot be a property of skin, in words.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        let (value, percent) = (self.value, 100.0 * self.relative_sigma());
        let elsewhere = 100.0 * self.area_uncertainty;
        let hint = "one may have been noted wrong";
        if !PLAUSIBLE.contains(&value) {
            Some(format!("{value:.3} is not in 0.5 to 2; look through the loads, {hint}"))
        } else if percent > 100.0 * RELATIVE_SIGMA_MAX {
            Some(format!("the loads disagree: it is known to {percent:.0} % only; {hint}"))
        } else if let Some(why) = too_few(self.loads, self.places, self.unplaced) {
            Some(why)
        } else if elsewhere > 100.0 * RELATIVE_SIGMA_MAX {
            Some(format!("the loads disagree: another place is known to {elsewhere:.0} % only; {hint}, or lay more"))
        } else {
            None
        }
    }

    /// Its own relative standard uncertainty.
    #[must_use]
    pub fn relative_sigma(&self) -> f64 {
        self.sigma / self.value
    }
}

/// What all known loads may be off by together, as one balance is or one force sensor: the least of their relative uncertainties.
/// No number of loads takes it away.
fn common_rel(loads: &[&Load]) -> f64 {
    loads.iter().map(|load| load.force_sigma_n / load.force_n).fold(f64::INFINITY, f64::min)
}

/// The relative standard uncertainty of the areas at another place.
fn elsewhere(points: &[Point], value: f64, laid: &LaidAt) -> f64 {
    let count = laid.place.iter().max().map_or(0, |last| last + 1);
    let mut of_place = vec![(0.0, 0.0); count];
    for (point, place) in points.iter().zip(&laid.place) {
        let a = point.weight * (value * point.read).powi(2);
        let (weight, weighted) = &mut of_place[*place];
        *weight += a;
        *weighted += a * point.laid / (value * point.read);
    }
    let total: f64 = of_place.iter().map(|(a, _)| a).sum();
    let squares: f64 = of_place.iter().map(|(a, _)| a * a).sum();
    let deviations: f64 = of_place.iter().map(|(a, weighted)| a * (weighted / a - 1.0).powi(2)).sum();
    let degrees = laid.known.saturating_sub(1);
    let room = total - squares / total;
    let scatter = if count > 1 { ((deviations - degrees as f64).max(0.0) / room).sqrt() } else { 0.0 };
    let half_t = half_student(degrees);
    let mean = half_t * (1.0 / total + (scatter.max(PLACE_REL) / total).powi(2) * squares).sqrt();
    mean.hypot((half_t * scatter).max(PLACE_REL))
}

/// Half of Student's t, and not less than 1; without any degree of freedom that of one.
fn half_student(degrees: usize) -> f64 {
    let known = STUDENT.get(degrees.max(1) - 1).copied();
    // Beyond the table to 0.5 %.
    0.5 * known.unwrap_or(1.96 + 2.5 / degrees as f64).max(2.0)
}

/// A load as the fit sees it, in N at the configured areas.
struct Point {
    read: f64,
    laid: f64,
    weight: f64,
}

impl Point {
    fn of(load: &Load) -> Self {
        let area_n = load.area_uncertainty * load.read.mean_n;
        let stated = (load.read.sigma_n.powi(2) - area_n * area_n).max(0.0);
        let read_variance = (stated + load.scatter_of_mean_n().powi(2)) / load.area_factor.powi(2);
        let least = RELATIVE_SIGMA_MIN * load.force_n;
        let variance = (read_variance + load.force_sigma_n.powi(2)).max(least * least);
        Self { read: load.read.mean_n / load.area_factor, laid: load.force_n, weight: 1.0 / variance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loads::load::Reading;
    use proptest::prelude::*;

    fn load(laid: f64, read: f64, sigma: f64) -> Load {
        // Somewhere else than any other load of another force.
        let taxels = vec![(1000.0 * laid) as u16];
        let read = Reading { scans: 20, mean_n: read, sigma_n: sigma, taxels, ..Reading::default() };
        Load { force_n: laid, read, area_factor: 1.0, ..Load::default() }
    }

    fn estimate(loads: &[Load]) -> Option<AreaFactor> {
        AreaFactor::estimate(loads)
    }

    #[test]
    fn equal_weights_give_the_plain_formula() {
        let loads = [load(2.2, 2.0, 0.1), load(4.0, 4.0, 0.1), load(6.6, 6.0, 0.1)];
        let factor = estimate(&loads).unwrap();
        let k = (2.2 * 2.0 + 4.0 * 4.0 + 6.6 * 6.0) / (4.0 + 16.0 + 36.0);
        assert!((factor.value - k).abs() < 1e-12);
        let chi2 = [2.2 - 2.0 * k, 4.0 - 4.0 * k, 6.6 - 6.0 * k].map(|r| r * r / 0.01).iter().sum::<f64>() / 2.0;
        assert!(chi2 > 1.0);
        assert!((factor.sigma - (chi2 * 0.01 / 56.0).sqrt()).abs() < 1e-12);
        assert_eq!(factor.loads, 3);
    }

    #[test]
    fn two_loads_are_not_enough_and_a_mistake_is_doubted() {
        assert_eq!(estimate(&[load(2.0, 2.0, 0.1), load(4.0, 4.0, 0.1)]), None);
        let grams = [2.0, 4.0, 6.0].map(|n| load(1000.0 * n, n, 0.1));
        assert!(estimate(&grams).unwrap().doubt().unwrap().contains("0.5 to 2"));
        let one_wrong = [load(2.0, 2.0, 0.1), load(4.0, 4.0, 0.1), load(12.0, 6.0, 0.1)];
        assert!(estimate(&one_wrong).unwrap().doubt().unwrap().contains("disagree"));
        assert_eq!(estimate(&[2.0, 4.0, 6.0].map(|n| load(n, n, 0.1))).unwrap().doubt(), None);
    }

    #[test]
    fn loads_at_one_place_are_no_factor_of_the_skin() {
        let here = |laid: f64| {
            let load = load(laid, laid, 0.1);
            Load { read: Reading { taxels: vec![5, 6, 7], ..load.read }, ..load }
        };
        let one = estimate(&[2.0, 4.0, 6.0].map(here)).unwrap();
        assert_eq!((one.places, one.loads), (1, 3));
        assert!(one.doubt().unwrap().contains("1 of at least 3 places"), "{:?}", one.doubt());
        let mut three = [2.0, 4.0, 6.0].map(|n| load(n, n, 0.1)).to_vec();
        three.extend([2.0, 4.0].map(here));
        assert_eq!(estimate(&three).unwrap().doubt(), None);
    }

    #[test]
    fn what_areas_are_known_to_elsewhere_is_never_better_than_skins_scatter() {
        let many: Vec<_> = (0..60_u16).map(|n| load(4.0 + f64::from(n), 4.0 + f64::from(n), 0.1)).collect();
        let known = estimate(&many).unwrap().area_uncertainty;
        assert!((0.03..0.0312).contains(&known), "{known}");
        let agree = estimate(&[2.0, 4.0, 6.0].map(|n| load(n, n, 1e-3))).unwrap().area_uncertainty;
        assert!((0.04..0.06).contains(&agree), "of three places: {agree}");
    }

    /// A spring scale that is known to a tenth: sixty loads know no better.
    #[test]
    fn what_all_loads_may_be_off_by_together_is_in_the_areas_however_many_they_are() {
        let many: Vec<_> = (0..60_u16)
            .map(|n| 4.0 + f64::from(n))
            .map(|n| Load { force_sigma_n: 0.1 * n, ..load(n, n, 0.01 * n) })
            .collect();
        let known = estimate(&many).unwrap().area_uncertainty;
        assert!((0.1..0.12).contains(&known), "{known}");
    }

    /// Ratios 1.11, 1 and 0.91 with equal weights: the standard deviation from place to place is 0.1, the mean has that of
    /// a third, and Student's t is 4.3.
    #[test]
    fn three_loads_that_scatter_say_little_of_another_place_however_often_they_are_repeated() {
        let once = [load(4.0, 3.6, 0.01), load(4.1, 4.1, 0.01), load(4.2, 4.62, 0.01)];
        let expected = 0.5 * 4.303 * 0.1 * (4.0_f64 / 3.0).sqrt();
        let first = estimate(&once).unwrap();
        assert!((first.area_uncertainty / expected - 1.0).abs() < 0.15, "{first:?}, {expected}");
        assert!(first.doubt().unwrap().contains("another place is known to"), "{:?}", first.doubt());
        let often: Vec<Load> = (0..30).map(|n| once[n % 3].clone()).collect();
        let repeated = estimate(&often).unwrap();
        assert_eq!((repeated.loads, repeated.places), (30, 3));
        assert!((repeated.area_uncertainty / first.area_uncertainty - 1.0).abs() < 0.02, "{repeated:?}");
    }

    #[test]
    fn loads_of_an_earlier_version_are_told_as_such() {
        let old = [2.0, 4.0, 6.0].map(|n| {
            let load = load(n, n, 0.1);
            Load { read: Reading { taxels: Vec::new(), ..load.read }, ..load }
        });
        let doubt = estimate(&old).unwrap().doubt().unwrap();
        assert!(doubt.contains("3 are of an earlier version"), "{doubt}");
        // They may lie at one of the two places that are known.
        let both = [old.as_slice(), &[load(3.0, 3.0, 0.1), load(5.0, 5.0, 0.1)]].concat();
        let factor = estimate(&both).unwrap();
        assert!((factor.places, factor.unplaced) == (2, 3) && factor.doubt().is_some(), "{factor:?}");
    }

    #[test]
    fn loads_without_any_uncertainty_are_still_finite() {
        let factor = estimate(&[2.0, 4.0, 6.0].map(|n| load(1.1 * n, n, 0.0))).unwrap();
        assert!((factor.value - 1.1).abs() < 1e-12 && factor.sigma > 0.0, "{factor:?}");
    }

    proptest! {
        /// Whatever factor was in use while a load was read, the estimate is the same.
        #[test]
        fn the_factor_in_use_does_not_matter(k in 0.6_f64..1.8, used in 0.6_f64..1.8, area in 0.0_f64..0.1) {
            let at = |used: f64| [3.0, 5.0, 8.0].map(|laid| {
                let read = laid / k * used;
                let sigma = (0.02 * read).hypot(area * read);
                Load { area_factor: used, area_uncertainty: area, ..load(laid, read, sigma) }
            });
            let (plain, found) = (estimate(&at(1.0)).unwrap(), estimate(&at(used)).unwrap());
            prop_assert!((found.value - k).abs() < 1e-9 && (plain.value - k).abs() < 1e-9);
            prop_assert!((found.sigma - plain.sigma).abs() < 1e-9);
        }

        /// An exact load decides, a vague one hardly counts.
        #[test]
        fn the_better_known_load_weighs_more(wrong in 0.8_f64..1.2) {
            let loads = [load(5.0, 5.0, 0.01), load(5.0, 5.0, 0.01), load(5.0 * wrong, 5.0, 1.0)];
            let factor = estimate(&loads).unwrap();
            prop_assert!((factor.value - 1.0).abs() < 1e-3, "{factor:?}");
        }
    }
}
