//! Beyond the calibrated range: a curve goes on with a slope that the whole skin has shown.
//!
//! The slope of one taxel's polynomial at its very end is its least certain figure: there the samples are few, and a
//! static curve bends where hysteresis turns. So the slope is a chord over the last quarter of the range, in units of the
//! taxel's mean slope, and the median of these ratios over the skin is half of what is used; the taxel's own ratio, kept
//! near that median, is the other half.
//!
//! Its uncertainty, as standard deviations that grow with the distance beyond the end:
//! - own: the scatter of the ratios over the skin, times what was added;
//! - shared by all taxels, because they are made alike: how much the median ratio changes from one quarter of the range
//!   to the next (a straight line cannot follow it), and [`SLOPE_REL`].
//!
//! The crate's README has what it gains on a real skin.

use crate::model::Sign;
use crate::numbers::median;
use crate::points::Served;

/// Share of the range over which an end's slope is taken.
const CHORD: f64 = 0.25;

/// Least standard uncertainty of the slope beyond the end, relative. Curves of a real skin (Belli et al. 2023) that saw
/// only the pressures below 200, 250 and 300 of 339 kPa were off by 10, 4 and 6 % of what they added: 7 % in the mean
/// square.
const SLOPE_REL: f64 = 0.07;

/// Least scatter of the taxels' slopes, relative, where too few taxels show one.
const SCATTER_REL: f64 = 0.05;

/// A taxel's own slope counts as far as it lies within so many standard deviations of the skin's.
const OWN_SLOPE_SIGMAS: f64 = 2.0;

/// A curve is extended by so much of its range, as far as was tried; beyond that it stays and only its uncertainty grows.
const REACH: f64 = 0.5;

/// Standard deviations in a median absolute deviation of a normal distribution.
const SIGMA_OF_MAD: f64 = 1.4826;

/// A curve and where it ends.
#[derive(Clone, Copy, Debug)]
pub struct End<'a> {
    /// The curve.
    pub curve: Served<'a>,
    /// Least and greatest calibrated count.
    pub range: [f64; 2],
    /// Which way the counts answer: the end of most pressure is the one that is extended.
    pub sign: Sign,
}

impl End<'_> {
    /// Pressure at a share of the range before the end, kPa.
    fn before(&self, share: f64) -> f64 {
        let [low, high] = self.range;
        self.curve.evaluate(self.count() - self.sign.as_f64() * share * (high - low))
    }

    /// The last calibrated count towards pressure.
    const fn count(&self) -> f64 {
        match self.sign {
            Sign::Rising => self.range[1],
            Sign::Falling => self.range[0],
        }
    }

    /// Mean slope over the range, kPa per count; `None` without one.
    fn mean_slope(&self) -> Option<f64> {
        let slope = (self.before(0.0) - self.before(1.0)) / (self.range[1] - self.range[0]);
        Some(slope).filter(|slope| slope.is_finite() && *slope > 0.0)
    }

    /// Slope over the quarter of the range that ends `from` (a share) before the end, over the mean slope.
    fn ratio(&self, from: f64, mean_slope: f64) -> f64 {
        let chord = self.before(from) - self.before(from + CHORD);
        chord / (CHORD * (self.range[1] - self.range[0]) * mean_slope)
    }
}

/// How the curves of a skin end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinSlope {
    /// Median over the taxels of the slope over the last quarter of the range, over the mean slope.
    ratio: f64,
    /// Standard deviation of that over the taxels.
    scatter: f64,
    /// By how much the median changed from the quarter before; not negative.
    bend: f64,
}

impl SkinSlope {
    /// What the curves of a skin have in common; `None` without one that has a slope.
    #[must_use]
    pub fn of<'a>(ends: impl IntoIterator<Item = End<'a>>) -> Option<Self> {
        let ratios = |end: End<'_>| {
            let mean = end.mean_slope()?;
            let pair = (end.ratio(0.0, mean), end.ratio(CHORD, mean));
            (pair.0.is_finite() && pair.1.is_finite()).then_some(pair)
        };
        let (last, before): (Vec<f64>, Vec<f64>) = ends.into_iter().filter_map(ratios).unzip();
        let ratio = median(last.clone());
        let deviation = median(last.iter().map(|r| (r - ratio).abs()).collect());
        let bend = (ratio - median(before)).abs();
        let scatter = (SIGMA_OF_MAD * deviation).max(SCATTER_REL);
        (!last.is_empty()).then_some(Self { ratio: ratio.max(0.0), scatter, bend })
    }

    /// How a taxel's curve goes on; `None` if it has no slope.
    #[must_use]
    pub fn extend(&self, end: &End<'_>) -> Option<Extension> {
        let mean = end.mean_slope()?;
        let near = OWN_SLOPE_SIGMAS * self.scatter;
        let own = end.ratio(0.0, mean).max(self.ratio - near).min(self.ratio + near);
        let slope_kpa = mean * (0.5 * (self.ratio + own)).max(0.0);
        let (from, sign, width_counts) = (end.count(), end.sign, end.range[1] - end.range[0]);
        Some(Extension { from, sign, width_counts, slope_kpa, mean_kpa: mean, skin: *self })
    }
}

/// How one taxel's curve goes on beyond its calibrated range, on the side of pressure; all per count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extension {
    from: f64,
    sign: Sign,
    width_counts: f64,
    slope_kpa: f64,
    mean_kpa: f64,
    skin: SkinSlope,
}

/// What a count beyond the range adds to the pressure at the range's end.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beyond {
    /// Pressure to add, kPa; not negative.
    pub kpa: f64,
    /// Standard uncertainty of that which the taxel has for itself, kPa.
    pub own_kpa: f64,
    /// Standard uncertainty that all taxels beyond their ranges have in common, kPa.
    pub shared_kpa: f64,
}

impl Beyond {
    /// The standard uncertainty, kPa.
    #[must_use]
    pub fn sigma_kpa(&self) -> f64 {
        self.own_kpa.hypot(self.shared_kpa)
    }
}

impl Extension {
    /// What `count` adds; nothing within the calibrated range, below it or for a count that is no number.
    #[must_use]
    pub fn at(&self, count: f64) -> Beyond {
        let distance = self.sign.as_f64() * (count - self.from);
        if !(distance > 0.0 && distance.is_finite()) {
            return Beyond::default();
        }
        let added = distance.min(REACH * self.width_counts);
        // The chord's slope is that of its middle, half a chord before the end. Beyond that the slope may change at least
        // as fast as before: curves of skin that stiffens bend more and more.
        let bend = added * self.mean_kpa * self.skin.bend * (0.5 + added / (CHORD * self.width_counts));
        let untold = (distance - added) * self.slope_kpa;
        Beyond {
            kpa: added * self.slope_kpa,
            own_kpa: distance * self.mean_kpa * self.skin.scatter,
            shared_kpa: (distance * self.mean_kpa * SLOPE_REL * self.skin.ratio).hypot(bend).hypot(untold),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;
    use proptest::prelude::*;

    /// A curve over 200..240 with a mean slope of `slope` kPa per count, rising or falling, and some bend.
    fn curve(slope: f64, bend: f64, sign: Sign) -> Curve {
        Curve { centre: 220.0, half_width: 20.0, chebyshev: vec![100.0, sign.as_f64() * 20.0 * slope, bend] }
    }

    const RANGE: [f64; 2] = [200.0, 240.0];

    #[test]
    fn straight_curves_go_on_straight_on_both_kinds_of_skin() {
        for (sign, outside, inside) in [(Sign::Falling, 195.0, 245.0), (Sign::Rising, 245.0, 195.0)] {
            let curves: Vec<Curve> = [3.0, 5.0, 8.0].map(|slope| curve(slope, 0.0, sign)).to_vec();
            let ends = || curves.iter().map(|curve| End { curve: curve.into(), range: RANGE, sign });
            let skin = SkinSlope::of(ends()).unwrap();
            for end in ends() {
                let beyond = skin.extend(&end).unwrap().at(outside);
                assert!((end.before(0.0) + beyond.kpa - end.curve.evaluate(outside)).abs() < 1e-9, "{beyond:?}");
                assert_eq!(skin.extend(&end).unwrap().at(inside), Beyond::default());
            }
        }
    }

    #[test]
    fn one_taxel_with_a_wild_end_follows_the_skin() {
        let mut curves = vec![curve(5.0, 0.0, Sign::Falling); 9];
        curves.push(curve(5.0, 60.0, Sign::Falling));
        let ends = || curves.iter().map(|curve| End { curve: curve.into(), range: RANGE, sign: Sign::Falling });
        let skin = SkinSlope::of(ends()).unwrap();
        let slope = |end| skin.extend(&end).unwrap().at(199.0).kpa;
        let (sound, wild) = (slope(ends().next().unwrap()), slope(ends().next_back().unwrap()));
        assert!((sound - 5.0).abs() < 1e-9, "{sound}");
        assert!((wild / 5.0 - 1.0).abs() <= SCATTER_REL + 1e-9, "{wild}");
    }

    #[test]
    fn without_a_slope_there_is_no_extension() {
        let flat = curve(0.0, 0.0, Sign::Rising);
        let end = End { curve: (&flat).into(), range: RANGE, sign: Sign::Rising };
        assert_eq!(SkinSlope::of([end]), None);
        assert_eq!(SkinSlope::of([]), None);
        let steep = curve(5.0, 0.0, Sign::Rising);
        let skin = SkinSlope::of([End { curve: (&steep).into(), ..end }]).unwrap();
        assert_eq!(skin.extend(&end), None);
    }

    proptest! {
        #[test]
        fn pressure_and_uncertainty_grow_with_the_distance(
            slopes in proptest::collection::vec((0.1..20.0_f64, -20.0..20.0_f64), 1..20),
            a in 0.0..300.0_f64, b in 0.0..300.0_f64, rising: bool,
        ) {
            let sign = if rising { Sign::Rising } else { Sign::Falling };
            let curves: Vec<Curve> = slopes.iter().map(|(slope, bend)| curve(*slope, *bend, sign)).collect();
            let ends = || curves.iter().map(|curve| End { curve: curve.into(), range: RANGE, sign });
            let Some(skin) = SkinSlope::of(ends()) else { return Ok(()) };
            for extension in ends().filter_map(|end| skin.extend(&end)) {
                let at = |distance: f64| extension.at(extension.from + sign.as_f64() * distance);
                let (near, far) = (at(a.min(b)), at(a.max(b)));
                prop_assert!(near.kpa >= 0.0 && far.kpa >= near.kpa, "{near:?} {far:?}");
                prop_assert!(far.sigma_kpa() >= near.sigma_kpa() && far.sigma_kpa().is_finite(), "{near:?} {far:?}");
            }
        }
    }
}
