//! The course of the pressure in a recording: its legs, where it rests, and groups of scans at equal pressure.

use crate::numbers::{distinct, mean, median};
use crate::options::MAX_MAGNITUDE;
use std::ops::Range;

/// A leg ends where the pressure has turned by this share of its range.
const TURN: f64 = 0.25;

/// Bins over the range of the pressure, in each leg.
const BINS: usize = 140;

/// The curve's leg comes at least to this share of what the highest one reaches.
const HIGH: f64 = 0.9;

/// Rest is what lies this long before the pressure leaves its level, seconds ...
const REST_S: f64 = 5.0;

/// ... by this share of its range.
const REST_SHARE: f64 = 0.005;

/// A group of m scans weighs m / (m + this): what scans share does not average out.
const WEIGHT_SCANS: f64 = 3.0;

/// Folds of groups for the choice of a form.
const FOLDS: usize = 10;

/// Folds of groups whose scans are read by a fit without them.
pub(super) const READING_FOLDS: usize = 5;

/// Fewer scans than this in a leg are pressures in no order.
const LEG_SCANS: usize = 10;

/// Scans of one pressure in one leg.
#[derive(Debug)]
pub(super) struct Group {
    /// Scans in the order of [`Course::order`].
    pub scans: Vec<usize>,
    /// Mean pressure, kPa.
    pub kpa: f64,
    /// Its weight, below 1.
    pub weight: f64,
    /// Whether the pressure rises.
    pub rising: bool,
    /// Whether the curve is fitted to it.
    pub on_curve: bool,
    /// It is left out with the others of this number.
    pub fold: usize,
}

/// What of a recording is the same for all its taxels.
#[derive(Debug)]
pub(super) struct Course {
    /// Rows of the recording with a pressure: in the order of time, or of pressure where time does not matter.
    pub order: Vec<usize>,
    /// Their pressures, kPa.
    pub kpa: Vec<f64>,
    /// Whether the pressures are held or typed: few distinct ones, each a group.
    pub plateaus: bool,
    /// Scans at the least pressure or before the curve's leg.
    pub rest: Vec<usize>,
    /// Their mean pressure, kPa.
    pub rest_kpa: f64,
    /// Groups of scans.
    pub groups: Vec<Group>,
}

impl Course {
    /// The course of `kpa` over `time_s`; rows without a pressure of at most [`MAX_MAGNITUDE`] are left out. Where the `zeros_known` are those of no
    /// pressure, nothing of it is rest. `Err` has the number of distinct pressures where they are fewer than three.
    pub fn new(time_s: &[f64], kpa: &[f64], zeros_known: bool) -> Result<Self, usize> {
        let known = time_s.iter().zip(kpa).enumerate().filter(|(_, (t, p))| t.is_finite() && p.abs() <= MAX_MAGNITUDE);
        let mut order: Vec<usize> = known.map(|(row, _)| row).collect();
        order.sort_by(|a, b| time_s[*a].total_cmp(&time_s[*b]));
        let read = |order: &[usize]| order.iter().map(|row| kpa[*row]).collect::<Vec<f64>>();
        let in_time = read(&order);
        let distinct = distinct(in_time.clone());
        if distinct < 3 {
            return Err(distinct);
        }
        // Few distinct pressures are held or typed.
        let plateaus = distinct < 200 && (order.len() < 280 || distinct < 60);
        let found = legs(&in_time);
        let mut backwards = false;
        if plateaus || order.len() < LEG_SCANS * found.len() {
            order.sort_by(|a, b| kpa[*a].total_cmp(&kpa[*b]));
        } else if !found.iter().any(|leg| leg.rising) {
            // A fall that is read backwards is a rise.
            order.reverse();
            backwards = true;
        }
        let kpa = read(&order);
        let sign = if backwards { -1.0 } else { 1.0 };
        let time: Vec<f64> = order.iter().map(|row| sign * time_s[*row]).collect();
        let legs = legs(&kpa);
        let (least, range) = extent(&kpa);
        let curve = curve_leg(&kpa, &legs, least);
        let rest: Vec<usize> = if zeros_known {
            Vec::new()
        } else if plateaus {
            (0..kpa.len()).take_while(|scan| kpa[*scan] == least).collect()
        } else {
            rest_scans(&time, &kpa, &curve, range)
        };
        let rest_kpa = if zeros_known { 0.0 } else { mean(rest.iter().map(|scan| kpa[*scan])) };
        let groups = if plateaus { plateau_groups(&kpa) } else { bin_groups(&kpa, &legs, &curve, &rest) };
        Ok(Self { order, kpa, plateaus, rest, rest_kpa, groups })
    }

    /// The fold in which a group is read. Levels that were held are left out with their neighbours: often these are of one day,
    /// and another day is what they have to tell. Legs have neighbours in each other.
    pub fn reading_fold(&self, group: usize) -> usize {
        if self.plateaus { group * READING_FOLDS / self.groups.len() } else { group % READING_FOLDS }
    }

    /// The values of a column in the order of the scans, gaps filled between their neighbours, and the scans of the gaps,
    /// ascending; `Err` has the share of the scans that are missing where it is more than `missing_max`.
    pub fn column(&self, counts: &[f64], missing_max: f64) -> Result<(Vec<f64>, Vec<usize>), f64> {
        let good = |count: f64| count.abs() <= MAX_MAGNITUDE;
        let read = |row: &usize| counts.get(*row).copied().filter(|count| good(*count)).unwrap_or(f64::NAN);
        let mut filled: Vec<f64> = self.order.iter().map(read).collect();
        let gaps: Vec<usize> = (0..filled.len()).filter(|scan| filled[*scan].is_nan()).collect();
        let missing = gaps.len() as f64 / filled.len() as f64;
        if missing > missing_max {
            return Err(missing);
        }
        fill(&mut filled);
        Ok((filled, gaps))
    }

    /// Of `values`, one a group, those of the groups that the curve is fitted to.
    pub fn of_curve(&self, values: &[f64]) -> Vec<f64> {
        self.groups.iter().zip(values).filter(|(group, _)| group.on_curve).map(|(_, value)| *value).collect()
    }

    /// Mean of `values`, one a scan, over each group, but for those of the `gaps`, ascending; NaN of a group that has no others.
    pub fn means(&self, values: &[f64], gaps: &[usize]) -> Vec<f64> {
        let known = |scan: &&usize| gaps.is_empty() || gaps.binary_search(scan).is_err();
        let of = |group: &Group| mean(group.scans.iter().filter(known).map(|scan| values[*scan]));
        self.groups.iter().map(of).collect()
    }
}

/// Puts on straight lines between their neighbours, by number, what is NaN; at the ends the nearest is held.
pub(super) fn fill(values: &mut [f64]) {
    let mut last: Option<usize> = None;
    for next in 0..values.len() {
        if values[next].is_nan() {
            continue;
        }
        let from = last.map_or(0, |last| last + 1);
        let before = last.map_or(values[next], |last| values[last]);
        let steps = (next + 1 - from) as f64;
        for (step, value) in (from..next).enumerate() {
            values[value] = before + (values[next] - before) * (step as f64 + 1.0) / steps;
        }
        last = Some(next);
    }
    if let Some(last) = last {
        let held = values[last];
        values[last + 1..].fill(held);
    }
}

/// Least value, and width of the range.
fn extent(kpa: &[f64]) -> (f64, f64) {
    let (low, high) = kpa.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    (low, high - low)
}

/// A stretch over which the pressure goes one way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leg {
    /// Its scans. The scan with the highest pressure ends a rise, the one after it begins a fall.
    pub scans: Range<usize>,
    /// Up, and not down.
    pub rising: bool,
}

/// Rising and falling parts by turns; together they are all scans.
#[must_use]
pub fn legs(kpa: &[f64]) -> Vec<Leg> {
    let back = Some(TURN * extent(kpa).1).filter(|back| *back > 0.0).unwrap_or(f64::INFINITY);
    let (mut high, mut low, mut first) = (0, 0, true);
    let mut rising: Option<bool> = None;
    let mut edges = vec![0];
    for (i, p) in kpa.iter().enumerate() {
        high = if *p > kpa[high] { i } else { high };
        low = if *p < kpa[low] { i } else { low };
        let (now, turn) = if rising != Some(true) && p - kpa[low] >= back {
            (true, low)
        } else if rising != Some(false) && kpa[high] - p >= back {
            (false, high + 1)
        } else {
            continue;
        };
        match rising {
            Some(_) => edges.push(turn),
            None => first = now,
        }
        (high, low) = if now { (i, low) } else { (high, i) };
        rising = Some(now);
    }
    edges.push(kpa.len());
    let leg = |(k, edge): (usize, &[usize])| Leg { scans: edge[0]..edge[1], rising: first == (k % 2 == 0) };
    edges.windows(2).enumerate().map(leg).collect()
}

/// The last of the rising legs that come near the highest one's end: a skin that was not pressed before answers
/// differently on its first ramp.
fn curve_leg(kpa: &[f64], legs: &[Leg], least: f64) -> Range<usize> {
    let top = |leg: &Leg| kpa[leg.scans.clone()].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let rising = || legs.iter().filter(|leg| leg.rising);
    let level = least + HIGH * (rising().map(top).fold(f64::NEG_INFINITY, f64::max) - least);
    rising().rfind(|leg| top(leg) >= level).map_or(0..kpa.len(), |leg| leg.scans.clone())
}

/// Scans of the last seconds before the pressure leaves its level at the beginning of the curve's leg.
fn rest_scans(time_s: &[f64], kpa: &[f64], leg: &Range<usize>, range_kpa: f64) -> Vec<usize> {
    let level = median(kpa[leg.start..(leg.start + 10).min(kpa.len())].to_vec()) + REST_SHARE * range_kpa;
    let leaves = leg.start + kpa[leg.clone()].iter().position(|p| *p > level).unwrap_or(0);
    let end = leaves.max(leg.start + 1);
    let begin = kpa[..end].iter().rposition(|p| *p > level).map_or(0, |high| high + 1);
    match time_s[begin..end].last() {
        Some(last) => (begin..end).filter(|scan| time_s[*scan] >= last - REST_S).collect(),
        None => vec![leg.start],
    }
}

fn group(scans: Vec<usize>, kpa: &[f64], rising: bool, on_curve: bool) -> Group {
    let n = scans.len() as f64;
    let mean_kpa = mean(scans.iter().map(|scan| kpa[*scan]));
    Group { scans, kpa: mean_kpa, weight: n / (n + WEIGHT_SCANS), rising, on_curve, fold: 0 }
}

/// Scans of equal pressure; `kpa` ascends.
fn plateau_groups(kpa: &[f64]) -> Vec<Group> {
    let mut begin = 0;
    let mut groups = Vec::new();
    for equal in kpa.chunk_by(|a, b| a == b) {
        let scans = (begin..begin + equal.len()).collect();
        groups.push(Group { fold: groups.len(), ..group(scans, kpa, true, true) });
        begin += equal.len();
    }
    groups
}

/// Scans of one bin of the pressure in one leg. The zero is fixed: rest is in no group.
fn bin_groups(kpa: &[f64], legs: &[Leg], curve: &Range<usize>, rest: &[usize]) -> Vec<Group> {
    let (least, range) = extent(kpa);
    let mut groups: Vec<Group> = Vec::new();
    for leg in legs {
        let mut bins: Vec<Vec<usize>> = vec![Vec::new(); BINS];
        for scan in leg.scans.clone().filter(|scan| rest.binary_search(scan).is_err()) {
            bins[(((kpa[scan] - least) / range * BINS as f64) as usize).min(BINS - 1)].push(scan);
        }
        for scans in bins.into_iter().filter(|scans| !scans.is_empty()) {
            let fold = groups.len() % FOLDS;
            groups.push(Group { fold, ..group(scans, kpa, leg.rising, leg.scans == *curve) });
        }
    }
    groups
}
