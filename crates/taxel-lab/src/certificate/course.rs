//! Which ramp, branch and pressure level each scan belongs to.

use taxel_engine::calibration::{Branch, SessionSamples};

/// Levels of pressure that figures are told of, of equal width from 0 to the highest calibrated pressure.
pub(super) const LEVELS: usize = 10;

/// Fewest scans whose mean says something.
pub(super) const SCANS_MIN: usize = 5;

/// Rising and falling.
const BRANCHES: usize = 2;

/// The scans of a session in ramps, branches and levels.
pub(super) struct Course {
    /// Pressure of each scan, kPa.
    pub kpa: Vec<f64>,
    /// Seconds since the first scan.
    pub time_s: Vec<f64>,
    /// Position of each scan's ramp.
    pub ramp: Vec<usize>,
    /// How many ramps there are.
    pub ramps: usize,
    /// Whether each scan is on a falling branch.
    pub falling: Vec<bool>,
    /// Width of a level, kPa.
    pub level_kpa: f64,
    /// Each scan's cell: ramp, branch and level.
    cell: Vec<usize>,
    /// Scans of each cell.
    scans: Vec<usize>,
}

impl Course {
    /// Of a session whose highest calibrated pressure is `top_kpa`. A ramp rises up to its first scan of greatest
    /// pressure and falls thereafter; where only rising pressure was gathered all of it rises.
    pub(super) fn of(samples: &SessionSamples, branches: Branch, top_kpa: f64) -> Self {
        let first_ns = samples.samples.first().map_or(0, |sample| sample.time_ns);
        let kpa = samples.pressures_kpa();
        let position = |ramp: u16| samples.ramps.iter().position(|known| known.ramp == ramp).unwrap_or(0);
        let ramp: Vec<usize> = samples.samples.iter().map(|sample| position(sample.ramp)).collect();
        let seconds = |ns: i64| (ns.saturating_sub(first_ns) as f64 * 1e-3).round() * 1e-6; // as exported: microseconds
        let time_s = samples.samples.iter().map(|sample| seconds(sample.time_ns)).collect();
        let ramps = samples.ramps.len();
        let falling = falling(&kpa, &ramp, ramps, branches);
        let level_kpa = top_kpa / LEVELS as f64;
        let level = |kpa: f64| ((kpa / level_kpa).max(0.0) as usize).min(LEVELS - 1);
        let cell: Vec<usize> = (0..kpa.len())
            .map(|scan| (ramp[scan] * BRANCHES + usize::from(falling[scan])) * LEVELS + level(kpa[scan]))
            .collect();
        let mut scans = vec![0; ramps * BRANCHES * LEVELS];
        cell.iter().for_each(|&cell| scans[cell] += 1);
        Self { kpa, time_s, ramp, ramps, falling, level_kpa, cell, scans }
    }

    /// The sum of a figure of each scan over each cell.
    pub(super) fn sums(&self, figure: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.scans.len()];
        self.cell.iter().zip(figure).for_each(|(&cell, figure)| sums[cell] += figure);
        sums
    }

    /// Scans of a level on a branch, over all ramps.
    pub(super) fn scans(&self, falling: bool, level: usize) -> usize {
        (0..self.ramps).map(|ramp| self.scans[Self::cell(ramp, falling, level)]).sum()
    }

    /// Mean of a figure over a level on a branch, over all ramps; `None` with too few scans.
    pub(super) fn mean(&self, sums: &[f64], falling: bool, level: usize) -> Option<f64> {
        let scans = self.scans(falling, level);
        let sum: f64 = (0..self.ramps).map(|ramp| sums[Self::cell(ramp, falling, level)]).sum();
        (scans >= SCANS_MIN).then(|| sum / scans as f64)
    }

    /// The same of one ramp's rise.
    pub(super) fn mean_of_rise(&self, sums: &[f64], ramp: usize, level: usize) -> Option<f64> {
        let cell = Self::cell(ramp, false, level);
        (self.scans[cell] >= SCANS_MIN).then(|| sums[cell] / self.scans[cell] as f64)
    }

    const fn cell(ramp: usize, falling: bool, level: usize) -> usize {
        (ramp * BRANCHES + falling as usize) * LEVELS + level
    }
}

fn falling(kpa: &[f64], ramp: &[usize], ramps: usize, branches: Branch) -> Vec<bool> {
    if branches == Branch::Rising {
        return vec![false; kpa.len()];
    }
    let mut top: Vec<Option<usize>> = vec![None; ramps];
    for scan in 0..kpa.len() {
        let Some(top) = top.get_mut(ramp[scan]) else { continue };
        if top.is_none_or(|top| kpa[scan] > kpa[top]) {
            *top = Some(scan);
        }
    }
    (0..kpa.len()).map(|scan| top[ramp[scan]].is_some_and(|top| scan > top)).collect()
}
