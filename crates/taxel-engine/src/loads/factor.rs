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
//! skin differs from place to place. With `s^2 = max(0, chi^2 - 1) / mean(w k^2 x^2)`, the scatter beyond what the readings
//! state, and Student's t for n - 1 degrees of freedom,
//!
//! `u_area^2 = (t / 2 u(k) / k)^2 + max(t / 2 s, 0.03)^2`,
//!
//! so that twice this holds for 95 % of new places. Loads that happen to agree do not show that a skin has less than
//! [`PLACE_REL`].

use std::ops::RangeInclusive;

use crate::loads::load::Load;
use crate::loads::places::places;

/// Fewer loads, or loads at fewer places, tell nothing of their scatter.
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

/// Student's t for 95 % on both sides, for 2 and more degrees of freedom; beyond them 2 is close enough.
const STUDENT: [f64; 11] = [4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179];

/// The effective-area factor of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaFactor {
    /// What the configured areas are multiplied by, above 0.
    pub value: f64,
    /// Its standard uncertainty.
    pub sigma: f64,
    /// How many loads it is from, 3 or more.
    pub loads: usize,
    /// At how many places of the patch they lay, 1 or more.
    pub places: usize,
    /// How much the loads scatter beyond what their readings state, relative to them.
    pub scatter: f64,
}

impl AreaFactor {
    /// The factor that `loads` give on a patch of so many taxels; `None` if they are fewer than three.
    #[must_use]
    pub fn estimate<'a>(loads: impl IntoIterator<Item = &'a Load>, taxels: usize) -> Option<Self> {
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
        let scatter = ((chi2 - 1.0).max(0.0) * n as f64 / xx).sqrt() / value;
        let places = places(loads.iter().map(|load| load.read.taxels.as_slice()), taxels);
        (value.is_finite() && sigma.is_finite()).then_some(Self { value, sigma, loads: n, places, scatter })
    }

    /// Why it cannot be a property of skin, in words.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        let (value, percent) = (self.value, 100.0 * self.relative_sigma());
        let hint = "one may have been noted wrong";
        if !PLAUSIBLE.contains(&value) {
            Some(format!("{value:.3} is not in 0.5 to 2; look through the loads, {hint}"))
        } else if percent > 100.0 * RELATIVE_SIGMA_MAX {
            Some(format!("the loads disagree: it is known to {percent:.0} % only; {hint}"))
        } else if self.places < LOADS_MIN {
            Some(format!(
                "the {} loads lie at {} of at least {LOADS_MIN} places, and another place may differ: lay loads where other \
                 taxels feel them",
                self.loads, self.places
            ))
        } else {
            None
        }
    }

    /// Its own relative standard uncertainty.
    #[must_use]
    pub fn relative_sigma(&self) -> f64 {
        self.sigma / self.value
    }

    /// Relative standard uncertainty of the areas at a place where no load was laid.
    #[must_use]
    pub fn area_uncertainty(&self) -> f64 {
        let degrees = self.loads.max(LOADS_MIN) - 1;
        let half_t = 0.5 * STUDENT.get(degrees - 2).copied().unwrap_or(2.0).max(2.0);
        (half_t * self.relative_sigma()).hypot((half_t * self.scatter).max(PLACE_REL))
    }
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
        AreaFactor::estimate(loads, 1000)
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
        let agree = estimate(&[2.0, 4.0, 6.0].map(|n| load(n, n, 1e-3))).unwrap();
        assert!(agree.scatter.abs() < 1e-12 && (agree.area_uncertainty() - 0.03).abs() < 1e-3, "{agree:?}");
        // Three loads that scatter by 10 % and state 1 %: with 2 degrees of freedom that may well be twice as much.
        let scattered = estimate(&[load(4.0, 3.6, 0.04), load(4.1, 4.1, 0.04), load(4.2, 4.62, 0.04)]).unwrap();
        assert!((0.09..0.11).contains(&scattered.scatter), "{scattered:?}");
        let elsewhere = scattered.area_uncertainty();
        assert!(elsewhere > 2.1 * scattered.scatter && elsewhere < 2.6 * scattered.scatter, "{elsewhere}");
        let many: Vec<_> = (0..60_u16).map(|n| load(4.0 + f64::from(n), 4.0 + f64::from(n), 0.1)).collect();
        assert!((estimate(&many).unwrap().area_uncertainty() - 0.03).abs() < 1e-3);
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
