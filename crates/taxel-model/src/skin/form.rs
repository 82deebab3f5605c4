//! The form of the curves, one for the whole skin: u(P) = sum c_i J_i(x), x = g(max(P - zone, 0)).
//!
//! J_i(x) are sums of the Bernstein polynomials i..order: each rises from 0 to 1, so that coefficients c_i >= 0 make a
//! curve that rises. The warp g stretches light pressures, where skin answers most; below its dead zone it does not answer.

use super::course::Course;
use super::least_squares::{NONE_FREE, Normal, Row, UNKNOWNS};
use crate::numbers::{distinct, median, spread};

/// Highest order of a curve.
const ORDER_MAX: usize = 7;

/// Without a dead zone the best form has to err by more than so many times as with one: else zones fit the noise of light loads.
const ZONE_WINS: f64 = 1.02;

/// Taxels that choose the form.
const PILOTS: usize = 40;

/// Dead zones that are tried for the skin, shares of the range.
const ZONES_TRIED: [f64; 3] = [1.0 / 70.0, 2.0 / 70.0, 3.5 / 70.0];

/// A warped pressure beyond the range is held here.
const BEYOND: f64 = 1.02;

/// The unknown that stands for a zero that is fitted.
const ZERO_UNKNOWN: usize = UNKNOWNS - 1;

/// How pressure is stretched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warp {
    /// Not at all.
    None,
    /// ln(1 + q / (a R)), R being the range.
    Log(f64),
    /// Its square root.
    Root,
}

const WARPS: [Warp; 6] = [Warp::None, Warp::Log(1.0), Warp::Log(0.1), Warp::Log(0.02), Warp::Log(0.005), Warp::Root];

impl Warp {
    /// Pressure 0..`top` to 0..1.
    fn x(self, kpa: f64, top: f64) -> f64 {
        let share = kpa.max(0.0) / top;
        match self {
            Self::None => share,
            Self::Log(scale) => (share / scale).ln_1p() / scale.recip().ln_1p(),
            Self::Root => share.sqrt(),
        }
    }

    /// The inverse of [`Self::x`].
    pub(super) fn kpa(self, x: f64, top: f64) -> f64 {
        match self {
            Self::None => x * top,
            Self::Log(scale) => scale * top * (x * scale.recip().ln_1p()).exp_m1(),
            Self::Root => x * x * top,
        }
    }
}

/// The form of the curves of a skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// How the pressure is stretched.
    pub warp: Warp,
    /// Order of the curve.
    pub order: usize,
    /// Whether each taxel has a dead zone.
    pub dead_zone: bool,
    /// Whether the zero is fitted, because too few scans are unloaded.
    pub free_zero: bool,
}

/// Curves with a dead zone that are too stiff to take it in, and steep enough at light loads to part from it.
pub(super) const STIFF: Form = Form { warp: Warp::Log(0.02), order: 3, dead_zone: true, free_zero: false };
/// Where they leave more than so many times the least variance, what they take for a dead zone is a skin that is soft at first: a real
/// insole has 16, made-up skins with play and without 1.4 to 2.2.
const STIFF_TIE: f64 = 3.0;

impl Form {
    /// The unknown without a bound.
    pub(super) const fn free(&self) -> usize {
        if self.free_zero { ZERO_UNKNOWN } else { NONE_FREE }
    }

    /// J_1..J_order at `x`, and 1 for a zero that is fitted.
    pub(super) fn row(&self, x: f64) -> Row {
        let mut polynomials = [0.0; ORDER_MAX + 1];
        polynomials[0] = 1.0;
        for degree in 1..=self.order {
            for k in (0..=degree).rev() {
                let before = if k > 0 { polynomials[k - 1] } else { 0.0 };
                polynomials[k] = (1.0 - x) * polynomials[k] + x * before;
            }
        }
        let mut row = Row::default();
        let mut sum = 0.0;
        for i in (1..=self.order).rev() {
            sum += polynomials[i];
            row[i - 1] = sum;
        }
        if self.free_zero {
            row[ZERO_UNKNOWN] = 1.0;
        }
        row
    }

    /// The row of a pressure above rest with this dead zone, all in kPa.
    pub(super) fn row_at(&self, above_rest_kpa: f64, zone_kpa: f64, top_kpa: f64) -> Row {
        self.row(self.warp.x(above_rest_kpa - zone_kpa, top_kpa - zone_kpa).clamp(0.0, BEYOND))
    }
}

/// The weighted sums of row times value.
pub(super) fn moments<'a>(terms: impl Iterator<Item = (&'a Row, f64, f64)>) -> Row {
    let mut sums = Row::default();
    for (row, weight, value) in terms {
        sums.iter_mut().zip(row).for_each(|(sum, a)| *sum += weight * value * a);
    }
    sums
}

pub(super) fn dot(row: &Row, coefficients: &Row) -> f64 {
    row.iter().zip(coefficients).map(|(a, c)| a * c).sum()
}

/// Groups with their rows, divided into folds that are left out one by one.
pub(super) struct Folds {
    rows: Vec<Row>,
    weight: Vec<f64>,
    fold: Vec<usize>,
    free: usize,
    /// Normal equations without each fold.
    without: Vec<Normal>,
}

impl Folds {
    /// `of` are rows, weights and folds of the groups.
    pub fn new(of: impl Iterator<Item = (Row, f64, usize)>, free: usize) -> Self {
        let (mut rows, mut weight, mut fold) = (Vec::new(), Vec::new(), Vec::new());
        let mut parts: Vec<Normal> = Vec::new();
        let mut all = Normal::default();
        for (row, w, k) in of {
            parts.resize(parts.len().max(k + 1), Normal::default());
            parts[k].add(&row, w);
            all.add(&row, w);
            rows.push(row);
            weight.push(w);
            fold.push(k);
        }
        let without = parts.iter().map(|part| all.less(part)).collect();
        Self { rows, weight, fold, free, without }
    }

    /// What each group's count is off from the curve that was fitted without its fold.
    pub fn residuals(&self, counts: &[f64]) -> Vec<f64> {
        let mut parts = vec![Row::default(); self.without.len()];
        let mut all = Row::default();
        for (((row, weight), k), count) in self.rows.iter().zip(&self.weight).zip(&self.fold).zip(counts) {
            for ((part, sum), a) in parts[*k].iter_mut().zip(&mut all).zip(row) {
                let term = weight * count * a;
                *part += term;
                *sum += term;
            }
        }
        let solve = |(normal, part): (&Normal, &Row)| {
            let left: Row = std::array::from_fn(|j| all[j] - part[j]);
            normal.solve(&left, self.free)
        };
        let solutions: Vec<Row> = self.without.iter().zip(&parts).map(solve).collect();
        let rows = self.rows.iter().zip(&self.fold).zip(counts);
        rows.map(|((row, k), count)| count - dot(row, &solutions[*k])).collect()
    }

    /// Weighted mean square of the residuals.
    fn error(&self, counts: &[f64]) -> f64 {
        let squares = self.residuals(counts).into_iter().zip(&self.weight).map(|(r, w)| w * r * r);
        squares.sum::<f64>() / self.weight.iter().sum::<f64>()
    }
}

/// Evenly chosen ones of `all`, 40 at most.
pub(super) fn pilots(all: &[usize]) -> Vec<usize> {
    let n = all.len().min(PILOTS);
    let place = |k: usize| (all.len() - 1) as f64 * k as f64 / (n.max(2) - 1) as f64;
    (0..n).map(|k| all[place(k).round_ties_even() as usize]).collect()
}

/// The forms of curves that were tried on a skin, each with its median left-out error.
pub(super) struct Tried(Vec<(Form, f64)>);

impl Tried {
    /// Of `pilots`, which have the counts of each, one a group of the curve.
    pub fn on(course: &Course, pilots: &[Vec<f64>], free_zero: bool, allow_zone: bool) -> Self {
        let on_curve = || course.groups.iter().filter(|group| group.on_curve);
        let top = on_curve().map(|group| group.kpa - course.rest_kpa).fold(0.0, f64::max);
        let spread: Vec<f64> = pilots.iter().map(|counts| spread(counts).powi(2)).collect();
        let largest = (distinct(on_curve().map(|group| group.kpa).collect()) / 2).clamp(1, ORDER_MAX);
        let error = |form: Form, zone: f64| {
            let row = |kpa: f64| form.row_at(kpa - course.rest_kpa, zone * top, top);
            let folds = Folds::new(on_curve().map(|g| (row(g.kpa), g.weight, g.fold)), form.free());
            median(pilots.iter().zip(&spread).map(|(counts, spread)| folds.error(counts) / spread).collect())
        };
        let forms = WARPS.into_iter().flat_map(|warp| (1..=largest).map(move |order| (warp, order)));
        let mut tried = Vec::new();
        for (warp, order) in forms {
            let without = Form { warp, order, dead_zone: false, free_zero };
            tried.push((without, error(without, 0.0)));
            if allow_zone {
                let with = Form { dead_zone: true, ..without };
                tried.push((with, ZONES_TRIED.map(|zone| error(with, zone)).into_iter().fold(f64::INFINITY, f64::min)));
            }
        }
        Self(tried)
    }

    /// The one of the least error with a dead zone, or of those without; infinite if none was tried. Of equal ones the first stands.
    fn best(&self, dead_zone: bool) -> (Form, f64) {
        let those = self.0.iter().filter(|(form, _)| form.dead_zone == dead_zone);
        let best = those.min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.copied().unwrap_or((Form { dead_zone, ..self.0[0].0 }, f64::INFINITY))
    }

    /// Whether [`STIFF`] curves do not err by much more than the best.
    pub fn stiff_fits(&self) -> bool {
        let least = f64::min(self.best(false).1, self.best(true).1);
        self.0.iter().any(|(form, error)| *form == STIFF && *error <= STIFF_TIE * least)
    }

    /// The form of the least error. A dead zone has to win clearly, unless the skin is known to have one.
    pub fn chosen(&self, has_zone: bool) -> Form {
        let [(without, without_error), (with, with_error)] = [false, true].map(|dead_zone| self.best(dead_zone));
        if has_zone || with_error * ZONE_WINS < without_error { with } else { without }
    }
}
