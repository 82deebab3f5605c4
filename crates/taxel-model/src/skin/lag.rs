//! Hysteresis as plays: what a falling pressure leaves behind in the counts.
//!
//! A play of radius r follows the load only beyond its slack: z <- clip(z, v - r, v + r). Its lag is how far it stays
//! behind one that was loaded from rest for the first time, so a load that is put on reads the curve, whatever was recorded.

use super::least_squares::{NONE_FREE, Normal, Row};

/// Radii, shares of the taxel's swing.
pub(super) const RADII: [f64; 4] = [0.01, 0.03, 0.08, 0.2];

/// Plays follow the mean of so many scans: the noise of single ones would drag them.
pub const SCANS: usize = 8;

/// How far the mean of a load that lies there for seconds drags a play ahead of it, standard deviations of that mean.
pub(super) const SLACK_SIGMAS: f64 = 1.5;

/// The lags of the plays in one scan, counts.
pub(super) type Lag = [f32; RADII.len()];

/// The lags along `load` counts, which begin at rest, of a taxel with this swing.
pub(super) fn lags(load: &[f64], swing: f64) -> Vec<Lag> {
    let radii = RADII.map(|share| share * swing);
    let mut state = radii;
    let mut sum = 0.0;
    let mut sums = Vec::with_capacity(load.len() + 1);
    sums.push(0.0);
    let follow = |(scan, u): (usize, &f64)| {
        sum += u;
        sums.push(sum);
        let begin = (scan + 1).saturating_sub(SCANS);
        let v = (sum - sums[begin]) / (scan + 1 - begin) as f64;
        std::array::from_fn(|k| {
            let r = radii[k];
            state[k] = state[k].max(v - r).min(v + r);
            (state[k] - r.max(v - r).min(v + r)) as f32
        })
    };
    load.iter().enumerate().map(follow).collect()
}

/// Pressure per count of lag, kPa, not negative: what the lags take off the readings of falling groups. Of each group its
/// weight, its mean lag, and by how much the curve reads it too high, kPa.
pub(super) fn weights(groups: impl Iterator<Item = (f64, [f64; RADII.len()], f64)>) -> [f64; RADII.len()] {
    let (mut normal, mut moments) = (Normal::default(), Row::default());
    for (weight, lag, excess_kpa) in groups {
        let mut row = Row::default();
        row[..RADII.len()].copy_from_slice(&lag);
        normal.add(&row, weight);
        moments.iter_mut().zip(&row).for_each(|(sum, a)| *sum += weight * excess_kpa * a);
    }
    let x = normal.solve(&moments, NONE_FREE);
    std::array::from_fn(|k| x[k])
}

/// Mean lag over some scans.
pub(super) fn mean(lags: &[Lag], scans: &[usize]) -> [f64; RADII.len()] {
    let n = scans.len() as f64;
    std::array::from_fn(|k| scans.iter().map(|scan| f64::from(lags[*scan][k])).sum::<f64>() / n)
}

/// What the lags take off a reading, kPa.
pub(super) fn taken_kpa(lag: [f64; RADII.len()], weights: &[f64; RADII.len()]) -> f64 {
    lag.iter().zip(weights).map(|(lag, weight)| lag * weight).sum()
}
