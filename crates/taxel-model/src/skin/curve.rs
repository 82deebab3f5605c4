//! A taxel's curve of counts on pressure, and its inverse: by points, or as the mean of all pressures that explain a count.

use std::borrow::Cow;

use super::course::Course;
use super::form::{Form, dot, moments};
use super::least_squares::{Normal, Row};
use crate::numbers::{distinct, interpolate, mean};

/// Dead zones that a taxel may have, shares of the range.
const ZONES: [f64; 13] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0];
const ZONES_OF: f64 = 70.0;

/// Points of the inverse, equally spaced in warped pressure.
const POINTS: usize = 129;

/// Least step of the counts from point to point, share of the curve's span: a flat stretch has an inverse, too.
const STEP: f64 = 1e-12;

/// A reading ends at this share of the largest calibrated pressure.
const LAST_READING: f64 = 1.1;

/// Points of the soft inverse, and the pressures that it weighs: shares of the range from this on, mirrored below rest.
const SOFT_POINTS: usize = 300;
const SOFT_PRESSURES: usize = 401;
const SOFT_FROM: f64 = -0.25;

/// What is farther from a count than this explains nothing of it, standard deviations.
const SOFT_REACH: f64 = 9.0;

/// The counts of one dead zone as a problem for all taxels.
struct Zone {
    kpa: f64,
    rows: Vec<Row>,
    normal: Normal,
    points_kpa: Vec<f64>,
}

/// The groups that curves are fitted to.
pub(super) struct Problem {
    pub form: Form,
    rest_kpa: f64,
    top_kpa: f64,
    /// Numbers of the groups, and their weights.
    groups: Vec<(usize, f64)>,
    zones: Vec<Zone>,
    points: Vec<Row>,
}

impl Problem {
    /// Of the groups that are `chosen`; `None` if their pressures are too few for the form.
    pub fn new(form: Form, course: &Course, chosen: impl Fn(usize) -> bool) -> Option<Self> {
        let of_curve = |g: &usize| course.groups[*g].on_curve && chosen(*g);
        let numbers: Vec<usize> = (0..course.groups.len()).filter(of_curve).collect();
        let kpa = || numbers.iter().map(|g| course.groups[*g].kpa);
        let top_kpa = kpa().fold(f64::NEG_INFINITY, f64::max) - course.rest_kpa;
        if distinct(kpa().collect()) <= form.order || top_kpa <= 0.0 {
            return None;
        }
        let x = |k: usize| k as f64 / (POINTS - 1) as f64;
        let zone = |share: &f64| {
            let kpa = share / ZONES_OF * top_kpa;
            let row = |g: &usize| form.row_at(course.groups[*g].kpa - course.rest_kpa, kpa, top_kpa);
            let rows: Vec<Row> = numbers.iter().map(row).collect();
            let mut normal = Normal::default();
            numbers.iter().zip(&rows).for_each(|(g, row)| normal.add(row, course.groups[*g].weight));
            let point = |k: usize| course.rest_kpa + kpa + form.warp.kpa(x(k), top_kpa - kpa);
            Zone { kpa, rows, normal, points_kpa: (0..POINTS).map(point).collect() }
        };
        let shares = if form.dead_zone { &ZONES[..] } else { &ZONES[..1] };
        Some(Self {
            form,
            rest_kpa: course.rest_kpa,
            top_kpa,
            groups: numbers.iter().map(|g| (*g, course.groups[*g].weight)).collect(),
            zones: shares.iter().map(zone).collect(),
            points: (0..POINTS).map(|k| form.row(x(k))).collect(),
        })
    }

    /// The curve of a taxel whose groups have these mean load counts, NaN where it has none, with the dead zone of least misfit.
    pub fn fit(&self, counts: &[f64]) -> LoadCurve {
        let lacks = self.groups.iter().any(|(g, _)| counts[*g].is_nan());
        let mut best: Option<(f64, &Zone, Row)> = None;
        for zone in &self.zones {
            let all = zone.rows.iter().zip(&self.groups).map(|(row, (g, weight))| (row, *weight, counts[*g]));
            let terms = || all.clone().filter(|(_, _, count)| !count.is_nan());
            let mut normal = Cow::Borrowed(&zone.normal);
            if lacks {
                let mut own = Normal::default();
                terms().for_each(|(row, weight, _)| own.add(row, weight));
                normal = Cow::Owned(own);
            }
            let coefficients = normal.solve(&moments(terms()), self.form.free());
            let misfit = terms().map(|(row, weight, u)| weight * (dot(row, &coefficients) - u).powi(2)).sum::<f64>();
            if best.as_ref().is_none_or(|(least, ..)| misfit < *least) {
                best = Some((misfit, zone, coefficients));
            }
        }
        let (zone, coefficients) = best.map_or((&self.zones[0], Row::default()), |(_, zone, c)| (zone, c));
        let mut counts: Vec<f64> = self.points.iter().map(|row| dot(row, &coefficients)).collect();
        let mut highest = f64::NEG_INFINITY;
        counts.iter_mut().for_each(|u| {
            highest = highest.max(*u);
            *u = highest;
        });
        let span = counts[POINTS - 1] - counts[0];
        counts.iter_mut().enumerate().for_each(|(k, u)| *u += STEP * span * k as f64);
        LoadCurve {
            zone_kpa: zone.kpa,
            rest_kpa: self.rest_kpa,
            top_kpa: self.top_kpa,
            counts,
            kpa: zone.points_kpa.clone(),
        }
    }

    /// Mean dead zone of taxels whose groups have these counts, kPa; less than half a step of those that are tried is none.
    pub fn dead_zone_kpa<'a>(&self, taxels: impl Iterator<Item = &'a [f64]>) -> f64 {
        let kpa = mean(taxels.map(|counts| self.fit(counts).zone_kpa));
        self.zones.get(1).filter(|step| 2.0 * kpa >= step.kpa).map_or(0.0, |_| kpa)
    }

    /// The row of a group's pressure with this dead zone.
    pub fn row(&self, kpa: f64, zone_kpa: f64) -> Row {
        self.form.row_at(kpa - self.rest_kpa, zone_kpa, self.top_kpa)
    }
}

/// Load counts (zero where nothing presses, turned so that load is positive) on pressure.
#[derive(Clone, Debug)]
pub(super) struct LoadCurve {
    /// Below this above rest the taxel does not answer, kPa.
    pub zone_kpa: f64,
    rest_kpa: f64,
    top_kpa: f64,
    /// Points of the curve, both ascending.
    pub counts: Vec<f64>,
    pub kpa: Vec<f64>,
}

impl LoadCurve {
    /// Load counts at a pressure.
    pub fn counts_at(&self, kpa: f64) -> f64 {
        interpolate(kpa, &self.kpa, &self.counts)
    }

    /// The width of the curve in counts.
    pub fn span(&self) -> f64 {
        self.counts[POINTS - 1] - self.counts[0]
    }

    /// Pressure of load counts as [`Self::inverse`] has it, at most a tenth beyond the range.
    pub fn read(&self, load: f64) -> f64 {
        self.inverse(load).min(LAST_READING * self.kpa[POINTS - 1])
    }

    /// Pressure of load counts: the end of the dead zone at and below zero, beyond the range the slope of the last tenth.
    pub fn inverse(&self, load: f64) -> f64 {
        let (counts, kpa) = (&self.counts, &self.kpa);
        let last = POINTS - 1;
        if load <= counts[last] {
            return interpolate(load, counts, kpa);
        }
        let tenth = 9 * POINTS / 10;
        let slope = (kpa[last] - kpa[tenth]) / (counts[last] - counts[tenth]);
        kpa[last] + (slope * (load - counts[last])).clamp(0.0, 0.5 * self.top_kpa)
    }

    /// Load counts and pressures of the soft inverse: the mean of all pressures that explain a count with noise `sigma`.
    /// Pressures are equally likely up to the end of the range, and mirrored below rest.
    pub fn soft(&self, sigma: f64) -> Soft {
        let top = self.top_kpa;
        let share = |k: usize| SOFT_FROM + (1.0 - SOFT_FROM) * k as f64 / (SOFT_PRESSURES - 1) as f64;
        let kpa: Vec<f64> = (0..SOFT_PRESSURES).map(|k| share(k) * top).collect();
        let mut counts: Vec<f64> = kpa.iter().map(|kpa| self.counts_at(kpa + self.rest_kpa)).collect();
        let start = self.counts[0];
        let k = kpa.iter().position(|kpa| *kpa >= self.zone_kpa + 0.02 * top).unwrap_or(SOFT_PRESSURES - 1);
        let slope = (counts[k] - start) / (kpa[k] - self.zone_kpa);
        kpa.iter().zip(&mut counts).filter(|(kpa, _)| **kpa < 0.0).for_each(|(kpa, u)| *u = start + slope * kpa);
        let sigma = sigma.max(STEP * self.span()).max(f64::MIN_POSITIVE);
        let (from, to) = (counts[0], counts[SOFT_PRESSURES - 1] + 4.0 * sigma);
        let (mut begin, mut end, mut highest) = (0, 0, f64::NEG_INFINITY);
        let mut soft = Soft { counts: Vec::with_capacity(SOFT_POINTS), kpa: Vec::with_capacity(SOFT_POINTS) };
        for point in 0..SOFT_POINTS {
            let u = from + (to - from) * point as f64 / (SOFT_POINTS - 1) as f64;
            while begin + 1 < SOFT_PRESSURES && counts[begin] < u - SOFT_REACH * sigma {
                begin += 1;
            }
            while end < SOFT_PRESSURES && (counts[end] <= u + SOFT_REACH * sigma || end <= begin) {
                end += 1;
            }
            let (mut sum, mut weights) = (0.0, 0.0);
            for (kpa, v) in kpa[begin..end].iter().zip(&counts[begin..end]) {
                let weight = (-0.5 * ((u - v) / sigma).powi(2)).exp() + 1e-300;
                sum += weight * kpa;
                weights += weight;
            }
            highest = f64::max(highest, sum / weights);
            soft.counts.push(u);
            soft.kpa.push(highest + self.rest_kpa);
        }
        soft
    }
}

/// A curve's inverse by points.
#[derive(Clone, Debug)]
pub(super) struct Soft {
    pub counts: Vec<f64>,
    pub kpa: Vec<f64>,
}

impl Soft {
    /// Pressure of load counts.
    pub fn read(&self, load: f64) -> f64 {
        interpolate(load, &self.counts, &self.kpa)
    }
}
