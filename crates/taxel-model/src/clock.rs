//! The clock of a gauge that another logger has recorded: how late it is, and how much faster it runs.
//!
//! The pressure under the right clock explains the counts: by a curve, and by play operators, through which counts come
//! late on both branches. The plays have to be in there, or hysteresis is taken for a lag: of 1.4 s on a real skin
//! whose clock is right to 0.1 s. A curve of the count makes it straight, so that plays of one weight serve the
//! whole range; it is fitted anew under each clock that is found.

use crate::nnls::nnls;
use std::ops::Range;

/// Radii of the plays as shares of the swing: more than a model has, so that no form of hysteresis is left to the clock.
const RADII: [f64; 6] = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32];

/// Powers of the pressure, the constant among them, and of the count in the curve that makes it straight.
const POWERS: usize = 6;

/// All regressors.
const COLUMNS: usize = POWERS + RADII.len();

/// No gauge's clock runs faster or slower than another by more than this, relative; loggers that lose readings were found
/// to differ by 0.6 to 1.4 %.
const RATE_MAX: f64 = 0.02;

/// About so many scans are used: neighbours in time say the same.
const ROWS: usize = 1000;

/// Fewest rows of each part.
const ROWS_MIN: usize = 100;

/// The clock may be off by at most this share of the recording.
const SHARE_MAX: f64 = 0.125;

/// Steps on each side of zero of the first, coarse search at both ends of the recording.
const COARSE: i32 = 6;

/// The curve that makes the counts straight is fitted so often, each time under the clock found last ...
const TURNS: usize = 4;

/// ... and the search goes on from there with steps of so many seconds.
const STEP_AGAIN_S: f64 = 0.32;

/// The search ends when its step is below this, seconds.
const STEP_MIN_S: f64 = 0.005;

/// A regressor of which less than this share (of squares) is its own depends on those before it.
const DEPENDENT: f64 = 1e-9;

/// A clock is used if it leaves at most so much of the error where it was not found.
const WINS_BELOW: f64 = 0.9;

/// A clock that is right to this is left as it is: nine of ten synthetic clocks were found within 0.25 s.
const MATTERS_S: f64 = 0.4;

/// A recording in which the gauge may have a clock of its own; all slices are of one length.
#[derive(Clone, Copy, Debug)]
pub struct ClockProblem<'a> {
    /// Time of each scan, seconds, ascending.
    pub time_s: &'a [f64],
    /// Mean count of the sound taxels, freed of noise; NaN where there is none.
    pub counts: &'a [f64],
    /// Pressure as it stands beside each scan, kPa; NaN where there is none.
    pub pressure_kpa: &'a [f64],
    /// The clock is looked for within so many seconds.
    pub max_s: f64,
}

/// What was found: at the counts' time t the gauge's own clock shows `t + offset_s + rate (t - middle_s)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundClock {
    /// How late the gauge is in the middle of the recording, seconds.
    pub offset_s: f64,
    /// How much faster its clock runs, relative.
    pub rate: f64,
    /// The middle of the recording, seconds.
    pub middle_s: f64,
    /// Error with this clock over that without, on the part that it was not found on.
    pub error_ratio: f64,
    /// Whether it wins there.
    pub wins: bool,
}

impl FoundClock {
    /// What the gauge's clock shows at a time of the counts, seconds.
    #[must_use]
    pub fn gauge_time_s(&self, time_s: f64) -> f64 {
        time_s + self.offset_s + self.rate * (time_s - self.middle_s)
    }
}

/// How far the gauge is late at the beginning and at the end of the recording, seconds.
type Ends = [f64; 2];

/// A symmetric matrix of the regressors.
type Square = [[f64; COLUMNS]; COLUMNS];

/// A scan that is used.
#[derive(Clone, Copy)]
struct Row {
    time_s: f64,
    /// Time as a share of the recording.
    share: f64,
    /// The count.
    count: f64,
    held_out: bool,
}

impl ClockProblem<'_> {
    /// Finds the clock on all but the scans `held_out`, and judges it there. If it wins it is found anew on all of them.
    ///
    /// `None` if the recording is too short, its time does not ascend, or too little of it has counts and pressure.
    #[must_use]
    pub fn find(&self, held_out: &Range<usize>) -> Option<FoundClock> {
        let (begin_s, end_s) = (*self.time_s.first()?, *self.time_s.last()?);
        let ascends = self.time_s.windows(2).all(|pair| pair[1] > pair[0]);
        let same = self.counts.len() == self.time_s.len() && self.pressure_kpa.len() == self.time_s.len();
        let max_s = self.max_s.min(SHARE_MAX * (end_s - begin_s));
        if !(ascends && same && max_s > STEP_MIN_S) {
            return None;
        }
        let gauge = Gauge::new(self.time_s, self.pressure_kpa)?;
        let (unseen, seen): (Vec<Row>, Vec<Row>) = self.rows(held_out).into_iter().partition(|row| row.held_out);
        if seen.len() < ROWS_MIN || unseen.len() < ROWS_MIN {
            return None;
        }
        let error = |ends| Some(Straight::new(&seen, &gauge, ends)?.error_on(&seen, &unseen, &gauge, ends));
        // A rate has to earn its place beside the offset, or it describes what the offset leaves of the hysteresis.
        let (offset, both) = (search(&seen, &gauge, max_s, false)?, search(&seen, &gauge, max_s, true)?);
        let (none_kpa, offset_kpa, both_kpa) = (error([0.0; 2])?, error(offset)?, error(both)?);
        let with_rate = both_kpa < WINS_BELOW * offset_kpa.min(none_kpa);
        let (found, found_kpa) = if with_rate { (both, both_kpa) } else { (offset, offset_kpa) };
        let error_ratio = found_kpa / none_kpa;
        let wins = error_ratio < WINS_BELOW && found.iter().any(|end| end.abs() >= MATTERS_S);
        let found = if wins {
            let mut all = [seen, unseen].concat();
            all.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            search(&all, &gauge, max_s, with_rate)?
        } else {
            found
        };
        let (middle_s, offset_s) = (0.5 * (begin_s + end_s), 0.5 * (found[0] + found[1]));
        let rate = (found[1] - found[0]) / (end_s - begin_s);
        error_ratio.is_finite().then_some(FoundClock { offset_s, rate, middle_s, error_ratio, wins })
    }

    /// The scans that have a count.
    fn rows(&self, held_out: &Range<usize>) -> Vec<Row> {
        let (begin_s, end_s) = (self.time_s[0], self.time_s[self.time_s.len() - 1]);
        let row = |i: usize| {
            let (time_s, count) = (self.time_s[i], self.counts[i]);
            let share = (time_s - begin_s) / (end_s - begin_s);
            count.is_finite().then(|| Row { time_s, share, count, held_out: held_out.contains(&i) })
        };
        (0..self.time_s.len()).step_by(self.time_s.len().div_ceil(ROWS).max(1)).filter_map(row).collect()
    }
}

/// The gauge's readings and what plays make of them: these know no time, so that a clock shifts them as a whole.
struct Gauge<'a> {
    time_s: &'a [f64],
    /// Powers of the pressure, and how far each play is behind it; in units of half the range.
    x: Vec<[f64; COLUMNS]>,
}

impl<'a> Gauge<'a> {
    /// `None` if the pressure never changes.
    fn new(time_s: &'a [f64], kpa: &[f64]) -> Option<Self> {
        let known = || kpa.iter().copied().filter(|p| p.is_finite());
        let (low, high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let half = 0.5 * (high - low);
        if half.is_nan() || half <= 0.0 {
            return None;
        }
        let mut plays: Option<[f64; RADII.len()]> = None;
        let of = |p: &f64| {
            if !p.is_finite() {
                return [f64::NAN; COLUMNS];
            }
            let u = (p - low) / half - 1.0;
            let mut z = plays.unwrap_or([u; RADII.len()]);
            for (z, radius) in z.iter_mut().zip(RADII) {
                *z = z.max(u - 2.0 * radius).min(u + 2.0 * radius);
            }
            plays = Some(z);
            std::array::from_fn(|k| k.checked_sub(POWERS).map_or_else(|| u.powi(k as i32), |play| z[play] - u))
        };
        Some(Self { time_s, x: kpa.iter().map(of).collect() })
    }

    /// The regressors at the rows, which ascend, if the clock is late by `ends`; linear between readings. NaN where the
    /// gauge has none.
    fn at(&self, rows: &[Row], ends: Ends) -> Vec<[f64; COLUMNS]> {
        let mut after = 0;
        let at = |row: &Row| {
            let t = row.time_s + ends[0] + row.share * (ends[1] - ends[0]);
            while after < self.time_s.len() && self.time_s[after] < t {
                after += 1;
            }
            if after == self.time_s.len() || t < self.time_s[0] {
                return [f64::NAN; COLUMNS];
            }
            let before = after.saturating_sub(1);
            let step = self.time_s[after] - self.time_s[before];
            let part = if step > 0.0 { (t - self.time_s[before]) / step } else { 0.0 };
            let (a, b) = (&self.x[before], &self.x[after]);
            std::array::from_fn(|k| a[k] + part * (b[k] - a[k]))
        };
        rows.iter().map(at).collect()
    }
}

/// Counts made straight: what a curve, fitted under no clock, reads of them, in units of half the range of pressure.
struct Straight {
    weights: [f64; POWERS],
    middle: f64,
    half: f64,
}

/// Weights of the regressors and the mean of the squares that they leave.
struct Explained {
    weights: [f64; COLUMNS],
    mean_square: f64,
}

impl Straight {
    /// `None` if the counts do not move.
    fn new(rows: &[Row], gauge: &Gauge<'_>, ends: Ends) -> Option<Self> {
        let (low, high) =
            rows.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), r| (lo.min(r.count), hi.max(r.count)));
        if high <= low {
            return None;
        }
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let powers = |row: &Row| {
            let u = (row.count - middle) / half;
            std::array::from_fn(|k| if k < POWERS { u.powi(k as i32) } else { 0.0 })
        };
        let x: Vec<[f64; COLUMNS]> = rows.iter().map(powers).collect();
        let gauge = gauge.at(rows, ends);
        // A scan for which this clock has no pressure is left out.
        let known = x.iter().zip(&gauge).filter(|(_, gauge)| !gauge[1].is_nan());
        let (x, y): (Vec<[f64; COLUMNS]>, Vec<f64>) = known.map(|(x, gauge)| (*x, gauge[1])).unzip();
        let explained = explain(&x, &y);
        Some(Self { weights: std::array::from_fn(|k| explained.weights[k]), middle, half })
    }

    fn read(&self, rows: &[Row]) -> Vec<f64> {
        let read = |row: &Row| {
            let u = (row.count - self.middle) / self.half;
            self.weights.iter().rev().fold(0.0, |sum, weight| sum * u + weight)
        };
        rows.iter().map(read).collect()
    }

    /// Root mean square error on rows `unseen` of what explains the rows `seen`, under one clock.
    fn error_on(&self, seen: &[Row], unseen: &[Row], gauge: &Gauge<'_>, ends: Ends) -> f64 {
        let weights = explain(&gauge.at(seen, ends), &self.read(seen)).weights;
        let pairs = gauge.at(unseen, ends).into_iter().zip(self.read(unseen)).filter(|(x, _)| !x[1].is_nan());
        let (squares, n) = pairs.fold((0.0, 0.0), |(sum, n), (x, y)| (sum + (dot(&x, &weights) - y).powi(2), n + 1.0));
        (squares / n).sqrt()
    }
}

/// The clock under which the rows are explained best; `None` if the counts do not move.
fn search(rows: &[Row], gauge: &Gauge<'_>, max_s: f64, with_rate: bool) -> Option<Ends> {
    let mut step = max_s / f64::from(COARSE);
    let mut found = [0.0; 2];
    for turn in 0..TURNS {
        let y = Straight::new(rows, gauge, found)?.read(rows);
        let mut seeker = Seeker { rows, gauge, y, max_s, with_rate, best: (found, f64::INFINITY) };
        seeker.take(found);
        if turn == 0 {
            let grid = -COARSE..=COARSE;
            let ends = grid.clone().flat_map(|a| grid.clone().map(move |b| [a, b].map(f64::from)));
            ends.for_each(|ends| seeker.take(ends.map(|end| step * end)));
        }
        seeker.refine(step);
        found = seeker.best.0;
        step = STEP_AGAIN_S;
    }
    Some(found)
}

/// The best clock so far.
struct Seeker<'a> {
    rows: &'a [Row],
    gauge: &'a Gauge<'a>,
    /// The counts, made straight.
    y: Vec<f64>,
    max_s: f64,
    /// Otherwise both ends are late alike.
    with_rate: bool,
    best: (Ends, f64),
}

impl Seeker<'_> {
    /// Tries a clock.
    fn take(&mut self, ends: Ends) {
        let span_s = self.rows.last().map_or(0.0, |row| row.time_s) - self.rows.first().map_or(0.0, |row| row.time_s);
        let rate = (ends[1] - ends[0]) / span_s;
        let allowed = if self.with_rate { rate.abs() <= RATE_MAX } else { rate == 0.0 };
        if allowed && ends.iter().all(|end| end.abs() <= self.max_s) {
            let found = explain(&self.gauge.at(self.rows, ends), &self.y).mean_square;
            if found < self.best.1 {
                self.best = (ends, found);
            }
        }
    }

    /// Walks to the best clock near the best one, from steps of `step` seconds down.
    fn refine(&mut self, mut step: f64) {
        // Offset and rate are less entangled than the two ends: steps go along both pairs of axes.
        const WAYS: [[f64; 2]; 8] =
            [[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
        while step > STEP_MIN_S {
            let from = self.best.0;
            WAYS.iter().for_each(|way| self.take([0, 1].map(|end| from[end] + step * way[end])));
            if self.best.0 == from {
                step *= 0.5;
            }
        }
    }
}

/// Least squares over powers and plays; a play's weight is not negative: hysteresis makes the counts late, never early.
fn explain(x: &[[f64; COLUMNS]], y: &[f64]) -> Explained {
    let (mut gram, mut right): (Square, _) = ([[0.0; COLUMNS]; COLUMNS], [0.0; COLUMNS]);
    let (mut n, mut y_squares) = (0.0, 0.0);
    for (x, y) in x.iter().zip(y).filter(|(x, _)| !x[1].is_nan()) {
        (n, y_squares) = (n + 1.0, y_squares + y * y);
        for j in 0..COLUMNS {
            right[j] += x[j] * y;
            for k in j..COLUMNS {
                gram[j][k] += x[j] * x[k];
            }
        }
    }
    let r = cholesky(&gram);
    let mut d = [0.0; COLUMNS];
    for k in 0..COLUMNS {
        let rest: f64 = (0..k).map(|j| r[j][k] * d[j]).sum();
        d[k] = if r[k][k] > 0.0 { (right[k] - rest) / r[k][k] } else { 0.0 };
    }
    let lags = POWERS..COLUMNS;
    let columns: Vec<Vec<f64>> = lags.clone().map(|k| lags.clone().map(|j| r[j][k]).collect()).collect();
    let mut weights = [0.0; COLUMNS];
    weights[POWERS..].copy_from_slice(&nnls(&columns, &d[POWERS..]));
    let left = |j: usize| (d[j] - lags.clone().map(|k| r[j][k] * weights[k]).sum::<f64>()).powi(2);
    let squares = y_squares - dot(&d, &d) + lags.clone().map(left).sum::<f64>();
    for k in (0..POWERS).rev() {
        let rest: f64 = (k + 1..COLUMNS).map(|j| r[k][j] * weights[j]).sum();
        weights[k] = if r[k][k] > 0.0 { (d[k] - rest) / r[k][k] } else { 0.0 };
    }
    let mean_square = if n >= ROWS_MIN as f64 { squares / n } else { f64::INFINITY };
    Explained { weights, mean_square }
}

/// The upper factor of a matrix of which the upper half is given; a regressor that says nothing new gets a row of zeros.
fn cholesky(gram: &Square) -> Square {
    let mut r = [[0.0; COLUMNS]; COLUMNS];
    for j in 0..COLUMNS {
        let pivot = gram[j][j] - (0..j).map(|i| r[i][j] * r[i][j]).sum::<f64>();
        if pivot.is_nan() || pivot <= DEPENDENT * gram[j][j] {
            continue;
        }
        r[j][j] = pivot.sqrt();
        for k in j + 1..COLUMNS {
            r[j][k] = (gram[j][k] - (0..j).map(|i| r[i][j] * r[i][k]).sum::<f64>()) / r[j][j];
        }
    }
    r
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests;
