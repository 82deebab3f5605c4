//! A monotone curve as points, and the curve that a model serves.

use crate::curve::Curve;
use crate::options::MAX_MAGNITUDE;
use serde::{Deserialize, Serialize};

/// P(C) on straight lines between points, held beyond them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Points {
    /// Counts, ascending.
    pub(crate) counts: Vec<f64>,
    /// The pressure at each of them, kPa.
    pub(crate) kpa: Vec<f64>,
}

impl Points {
    /// Points in ascending order of counts.
    #[must_use]
    pub const fn new(counts: Vec<f64>, kpa: Vec<f64>) -> Self {
        Self { counts, kpa }
    }

    /// The pressure at `count`, kPa; 0 without points.
    #[must_use]
    pub fn evaluate(&self, count: f64) -> f64 {
        let next = self.counts.partition_point(|c| *c <= count).min(self.counts.len().saturating_sub(1));
        let (Some(before), Some(kpa)) = (next.checked_sub(1), self.kpa.get(next)) else {
            return self.kpa.first().copied().unwrap_or(0.0);
        };
        let (from, to) = (self.counts[before], self.counts[next]);
        if count >= to {
            return *kpa;
        }
        let part = (count - from) / (to - from);
        // Of both ends, so that no pressure lies beyond them by rounding.
        (1.0 - part) * self.kpa[before] + part * kpa
    }

    /// The slope at `count`, kPa per count: that of the line it lies on.
    #[must_use]
    pub fn slope(&self, count: f64) -> f64 {
        let last = self.counts.len().saturating_sub(1);
        let next = self.counts.partition_point(|c| *c <= count).clamp(1, last.max(1));
        let (Some(from), Some(to)) = (self.counts.get(next - 1), self.counts.get(next)) else { return 0.0 };
        if to > from { (self.kpa[next] - self.kpa[next - 1]) / (to - from) } else { 0.0 }
    }

    /// Least and greatest count; `None` without two points that differ.
    #[must_use]
    pub fn range(&self) -> Option<[f64; 2]> {
        let (low, high) = (*self.counts.first()?, *self.counts.last()?);
        (low < high).then_some([low, high])
    }

    /// Where pressures are not finite numbers of one direction over counts that ascend, if they are not: a count there.
    pub(crate) fn problem(&self, sign: f64) -> Option<f64> {
        let is_good = |pair: &[f64]| pair[1] >= pair[0];
        let odd = self.counts.iter().chain(&self.kpa).any(|value| value.is_nan() || value.abs() > MAX_MAGNITUDE);
        if odd || self.counts.len() != self.kpa.len() || self.range().is_none() {
            return Some(self.counts.first().copied().unwrap_or(f64::NAN));
        }
        let turns = |pair: &[f64]| sign * (pair[1] - pair[0]) < 0.0;
        let place = self.counts.windows(2).zip(self.kpa.windows(2)).find(|(c, p)| !is_good(c) || turns(p));
        place.map(|(counts, _)| counts[0])
    }
}

/// What a model reads its counts by.
#[derive(Clone, Copy, Debug)]
pub enum Served<'a> {
    /// A polynomial.
    Polynomial(&'a Curve),
    /// Points.
    Points(&'a Points),
}

impl Served<'_> {
    /// The pressure at `count`, kPa.
    #[must_use]
    pub fn evaluate(&self, count: f64) -> f64 {
        match self {
            Self::Polynomial(curve) => curve.evaluate(count),
            Self::Points(points) => points.evaluate(count),
        }
    }

    /// The slope at `count`, kPa per count.
    #[must_use]
    pub fn slope(&self, count: f64) -> f64 {
        match self {
            Self::Polynomial(curve) => curve.slope(count),
            Self::Points(points) => points.slope(count),
        }
    }
}

impl<'a> From<&'a Curve> for Served<'a> {
    fn from(curve: &'a Curve) -> Self {
        Self::Polynomial(curve)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pressures_lie_on_lines_between_points_and_are_held_beyond() {
        let points = Points::new(vec![10.0, 20.0, 20.0, 40.0], vec![5.0, 3.0, 2.0, 0.0]);
        assert_eq!([5.0, 10.0, 15.0, 30.0, 40.0, 99.0].map(|c| points.evaluate(c)), [5.0, 5.0, 4.0, 1.0, 0.0, 0.0]);
        assert_eq!([0.0, 15.0, 30.0, 99.0].map(|c| points.slope(c)), [-0.2, -0.2, -0.1, -0.1]);
        assert_eq!((points.problem(-1.0), points.problem(1.0)), (None, Some(10.0)));
    }

    #[test]
    fn points_that_are_none_are_seen() {
        for (counts, kpa) in [
            (vec![], vec![]),
            (vec![1.0, 1.0], vec![0.0, 1.0]),
            (vec![1.0, 2.0], vec![0.0]),
            (vec![1.0, f64::NAN], vec![0.0, 1.0]),
            (vec![1.0, 2.0], vec![0.0, 1e200]),
            (vec![1.0, 3.0, 2.0, 4.0], vec![0.0, 1.0, 2.0, 3.0]),
        ] {
            let points = Points::new(counts, kpa);
            assert!(points.problem(1.0).is_some(), "{points:?}");
            assert!(points.kpa.len() < 2 || points.evaluate(1.5).is_finite() || points.evaluate(1.5).is_nan());
        }
    }
}
