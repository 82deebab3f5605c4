//! By what factor a skin reads too little or too much, from known loads: with its uncertainty, and refused where the
//! loads contradict each other.
//!
//! What lay there is gain times what was read. Beforehand a point has the standard deviation
//! `s^2 = u_known^2 + g^2 u_read^2 + (place_rel g read)^2 + floor^2`, with g the median of known over read, which
//! one wrong load does not move. Two tests, which sound loads fail in 1 % of all cases together:
//!
//! 1. Each point is compared with the line through all others. The farthest contradicts if it lies beyond what one of n
//!    normal deviates exceeds with probability [`FALSE_ALARMS`]; it is named.
//! 2. The sum of all squared deviations is compared with chi-square, beyond which it lies with probability
//!    [`FALSE_DISAGREEMENTS`]: several wrong loads may hide each other.
//!
//! Loads at one place are off together by what that place differs from the others, so their share of the variance of the
//! line does not fall with their number; and loads at fewer than three places say nothing of the rest of the skin.
//!
//! A single load that is wrong by seven times its own scatter is found in 99 % of all cases: with five loads the limit is
//! 3.1 standard deviations, 2.33 more make it sure, the distance from four others scatters by `sqrt(1 + 1/4)`, and loads of
//! several sizes do not weigh the same. Loads
//! that are all wrong by the same factor agree with each other: nothing but the bounds of the gain can find that.

use std::ops::RangeInclusive;

use taxel_skin::counted;

use crate::recalibration::line::{Line, LinePoint, chi2_quantile, normal_quantile};
use crate::recalibration::points::{Assumptions, LoadPoint};
use crate::statistics::median;

/// Fewer points do not show a wrong one among them with certainty.
pub const POINTS_MIN: usize = 5;

/// Loads at fewer places tell nothing of how much the skin differs from place to place.
const PLACES_MIN: usize = 3;

/// More are not needed, and all of them are kept with the set.
pub const POINTS_MAX: usize = 100;

/// Probability that one of the loads is named though all are sound.
pub const FALSE_ALARMS: f64 = 0.009;

/// Probability that sound loads are said to disagree as a whole.
pub const FALSE_DISAGREEMENTS: f64 = 0.001;

/// Ageing and another cover change a skin by no more than this; beyond it a unit or a load is wrong.
pub const GAINS: RangeInclusive<f64> = 0.5..=2.0;

/// A point that decides so much of the line at its own place cannot be compared with the others.
const LEVERAGE_MAX: f64 = 0.9;

/// A correction that leaves a new place vaguer than this is no correction.
const RELATIVE_SIGMA_MAX: f64 = 0.2;

/// A gain that differs from 1 by less than so many standard uncertainties corrects nothing.
const NEEDED_SIGMAS: f64 = 2.0;

/// A load point beside what the line says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedPoint {
    /// The point.
    pub point: LoadPoint,
    /// What the corrected skin reads there.
    pub corrected: f64,
    /// Distance from the line through all other points, in standard deviations of that distance; positive where more lay
    /// there than the others say.
    pub deviation: f64,
}

/// What known loads say of a skin.
#[derive(Clone, Debug, PartialEq)]
pub struct Recalibration {
    /// What readings are to be multiplied by.
    pub line: Line,
    /// By how much its variance is more because loads at one place are off together.
    shared: f64,
    /// The points, as they were given.
    pub points: Vec<JudgedPoint>,
    /// At how many places they are known to lie.
    pub places: usize,
    /// A deviation beyond this contradicts.
    pub deviation_max: f64,
    /// Number of the point that contradicts the others.
    pub contradicts: Option<u64>,
    /// What was assumed.
    pub assumptions: Assumptions,
    /// Why it must not be used, in words; empty if it may.
    pub refused_because: Vec<String>,
}

impl Recalibration {
    /// What these points say that lie at these places, counted from 0.
    ///
    /// # Errors
    /// In words: too few or too many points, or figures that are none.
    pub fn of(points: &[LoadPoint], places: &[usize], assumptions: Assumptions) -> Result<Self, String> {
        let count = points.len();
        if count < POINTS_MIN {
            let so_far = counted(count, "known load", "known loads");
            return Err(format!(
                "{so_far} so far; at least {POINTS_MIN} are needed, each at another place: taxeld load KG"
            ));
        }
        if count > POINTS_MAX {
            return Err(format!("{count} known loads; at most {POINTS_MAX} are taken"));
        }
        if let Some(problem) = assumptions.problem().or_else(|| points.iter().find_map(LoadPoint::problem)) {
            return Err(problem);
        }
        let weighed = weighed(points, places, &assumptions);
        let line = Line::through(&weighed).ok_or("the loads give no gain that is a number")?;
        let judge = |(&point, on): (&LoadPoint, &LinePoint)| {
            let (deviation, leverage) = line.deviation(on);
            (JudgedPoint { point, corrected: line.gain * point.read, deviation }, leverage)
        };
        let judged: Vec<(JudgedPoint, f64)> = points.iter().zip(&weighed).map(judge).collect();
        let deviation_max = normal_quantile(0.5 * FALSE_ALARMS / count as f64);
        let mut of = Self {
            line,
            shared: line.shared(&weighed),
            places: places.iter().max().map_or(0, |last| last + 1),
            points: judged.iter().map(|(point, _)| *point).collect(),
            deviation_max,
            contradicts: None,
            assumptions,
            refused_because: Vec::new(),
        };
        if let Some((alone, share)) = judged.iter().find(|(_, leverage)| *leverage > LEVERAGE_MAX) {
            let (number, percent) = (alone.point.number, 100.0 * share);
            of.refused_because.push(format!(
                "point {number} decides {percent:.0} % of the result at its load, so nothing can contradict it: take more \
                 loads like it"
            ));
        }
        if of.places < PLACES_MIN {
            let known = of.places;
            of.refused_because.push(format!(
                "the {count} loads lie at {known} of at least {PLACES_MIN} places, and another place may differ: lay loads where \
                 other taxels feel them"
            ));
        }
        of.find_contradiction(&weighed);
        of.find_implausible();
        Ok(of)
    }

    /// Whether it may be used.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.refused_because.is_empty()
    }

    /// Whether the skin is off by more than the loads can tell.
    #[must_use]
    pub fn is_needed(&self) -> bool {
        (self.line.gain - 1.0).abs() > NEEDED_SIGMAS * self.own_sigma()
    }

    /// Standard uncertainty of the gain, without what all loads have in common.
    fn own_sigma(&self) -> f64 {
        (self.widening() * (self.line.variance + self.shared)).sqrt()
    }

    /// Standard uncertainty of the gain.
    #[must_use]
    pub fn gain_sigma(&self) -> f64 {
        self.own_sigma().hypot(self.line.gain * self.common_rel())
    }

    /// What all known loads may be off by together, as one balance is or one force sensor: the least of their relative
    /// uncertainties. No number of loads takes it away.
    fn common_rel(&self) -> f64 {
        let of = |judged: &JudgedPoint| judged.point.known_sigma / judged.point.known;
        self.points.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// Relative standard uncertainty that a corrected set has by its gain, for any load: that of the gain, and the scatter
    /// from place to place, without what does not grow with the load.
    #[must_use]
    pub fn relative_sigma(&self) -> f64 {
        let place_rel = self.assumptions.place_rel;
        let assumed = self.widening().sqrt() * place_rel;
        // Who assumes less than skins are known for is right as far as the loads bear it out.
        let place =
            if place_rel < Assumptions::MASSES.place_rel { assumed.max(self.seen_place_rel()) } else { assumed };
        (self.gain_sigma() / self.line.gain).hypot(place)
    }

    /// How much the loads scatter about the line, relative to them.
    fn seen_place_rel(&self) -> f64 {
        let off = |judged: &JudgedPoint| (judged.corrected / judged.point.known - 1.0).powi(2);
        (self.points.iter().map(off).sum::<f64>() / self.line.dof).sqrt()
    }

    /// By what variances are multiplied: chi-square per degree of freedom where the loads agree worse than assumed (Birge
    /// 1932), and never less than 1.
    #[must_use]
    pub fn widening(&self) -> f64 {
        (self.line.chi2 / self.line.dof).max(1.0)
    }

    fn find_contradiction(&mut self, weighed: &[LinePoint]) {
        let farthest =
            self.points.iter().enumerate().max_by(|a, b| a.1.deviation.abs().total_cmp(&b.1.deviation.abs()));
        let Some((position, judged)) = farthest else { return };
        let (number, deviation) = (judged.point.number, judged.deviation);
        if deviation.abs() > self.deviation_max {
            let mut others = weighed.to_vec();
            others.remove(position);
            let point = judged.point;
            let rest = Line::through(&others).map_or(f64::NAN, |rest| rest.gain * point.read);
            let limit = self.deviation_max;
            self.contradicts = Some(number);
            self.refused_because.push(format!(
                "point {number} contradicts the others: it was noted as {:.3}, by the others it is {rest:.3}, {:.1} standard \
                 deviations away, where {limit:.1} are allowed. If it was noted wrong, replace it or leave it out",
                point.known,
                deviation.abs()
            ));
            return;
        }
        let most = chi2_quantile(FALSE_DISAGREEMENTS, self.line.dof);
        if self.line.chi2 > most {
            let scatter = 100.0 * self.assumptions.place_rel * self.widening().sqrt();
            self.refused_because.push(format!(
                "the loads disagree as a whole and none can be named: chi-square is {:.1}, where {most:.1} is allowed. They \
                 scatter by about {scatter:.0} % from place to place",
                self.line.chi2
            ));
        }
    }

    fn find_implausible(&mut self) {
        let (gain, percent) = (self.line.gain, 100.0 * self.relative_sigma());
        if !GAINS.contains(&gain) {
            self.refused_because.push(format!(
                "the gain would be {gain:.3}, and no skin ages by more than {} to {}: is a unit wrong, or the whole load?",
                GAINS.start(),
                GAINS.end()
            ));
        } else if percent > 100.0 * RELATIVE_SIGMA_MAX {
            self.refused_because.push(format!("a load at a new place would be known to {percent:.0} % only"));
        }
    }
}

/// The points with the standard deviation that each has beforehand.
fn weighed(points: &[LoadPoint], places: &[usize], assumptions: &Assumptions) -> Vec<LinePoint> {
    let ratio = median(points.iter().map(|p| p.known / p.read)).unwrap_or(1.0);
    let weigh = |(p, &place): (&LoadPoint, &usize)| {
        let place_sigma = assumptions.place_rel * ratio * p.read;
        let sigma = p.known_sigma.hypot(ratio * p.read_sigma).hypot(place_sigma).hypot(assumptions.floor);
        LinePoint { read: p.read, known: p.known, sigma, place, place_sigma }
    };
    points.iter().zip(places).map(weigh).collect()
}
