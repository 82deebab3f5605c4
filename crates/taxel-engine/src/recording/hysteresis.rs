//! How far the falling branch lies from the rising one, and whether plays earn their place.

use taxel_model::{PLAYS, PlayState, Plays, RADII_OF_SWING};

use crate::recording::{mean, quantile, root_mean_square};

/// The falling branch from here down, as a share of the range of pressure, is kept from the fit that is tried.
const HELD_OUT_BELOW: f64 = 0.5;

/// Pressures, as shares of the range, between which the width is measured: at the ends both branches meet.
const WIDTH_BETWEEN: (f64, f64) = (0.1, 0.85);

/// Fewest samples of a branch for a mean.
const SAMPLES_MIN: usize = 20;

/// The swing of a smoothed count between its 0.2 and 99.8 % points.
pub(super) fn swing(smoothed: &[f64], kpa: &[f64]) -> Option<f64> {
    let known: Vec<f64> = smoothed.iter().zip(kpa).filter(|(_, p)| p.is_finite()).map(|(c, _)| *c).collect();
    let swing = quantile(known.clone(), 0.998)? - quantile(known, 0.002)?;
    (swing > 0.0).then_some(swing)
}

/// Plays of one taxel over the whole recording.
pub(super) fn identify(smoothed: &[f64], kpa: &[f64]) -> Option<Plays> {
    Plays::identify(smoothed, kpa, radii(swing(smoothed, kpa)?))
}

fn radii(swing: f64) -> [f64; PLAYS] {
    RADII_OF_SWING.map(|share| share * swing)
}

/// The first scan of the held-out part: where the falling pressure passes the middle of its range. `None` if it does not.
pub(super) fn cut(kpa: &[f64], top: usize) -> Option<usize> {
    let low = quantile(kpa.to_vec(), 0.0)?;
    let middle = low + HELD_OUT_BELOW * (kpa.get(top)? - low);
    kpa.iter().skip(top).position(|p| *p < middle).map(|after| top + after)
}

/// Error with plays over that of the same curve without, both fitted before scan `cut` and judged from there on.
pub(super) fn error_ratio(smoothed: &[f64], kpa: &[f64], cut: usize) -> Option<f64> {
    let seen: Vec<f64> = kpa.iter().enumerate().map(|(i, p)| if i < cut { *p } else { f64::NAN }).collect();
    let swing = swing(smoothed, &seen)?;
    let error = |radii| {
        let plays = Plays::identify(smoothed, &seen, radii)?;
        let read = read(&plays, smoothed);
        let error = root_mean_square(read[cut..].iter().zip(&kpa[cut..]).map(|(read, p)| read - p));
        (error > 0.0).then_some(error)
    };
    Some(error(radii(swing))? / error([0.0; PLAYS])?)
}

/// The pressures that plays make of a smoothed count; NaN where there is none.
pub(super) fn read(plays: &Plays, smoothed: &[f64]) -> Vec<f64> {
    let mut state = PlayState::default();
    smoothed.iter().map(|&count| plays.evaluate(&mut state, count)).collect()
}

/// How much lower the gauge is at equal counts while the pressure falls, kPa: the mean of what the static curve reads
/// too high on the falling branch, less that on the rising one.
pub(super) fn width_kpa(static_read: &[f64], kpa: &[f64], top: usize) -> Option<f64> {
    let (low, high) = (quantile(kpa.to_vec(), 0.0)?, quantile(kpa.to_vec(), 1.0)?);
    let between = |p: &f64| {
        let share = (p - low) / (high - low);
        share >= WIDTH_BETWEEN.0 && share <= WIDTH_BETWEEN.1
    };
    let branch = |range: std::ops::Range<usize>| {
        let pairs = static_read[range.clone()].iter().zip(&kpa[range]).filter(|(_, p)| between(p));
        let (mean, n) = mean(pairs.map(|(read, p)| read - p));
        (n >= SAMPLES_MIN).then_some(mean)
    };
    Some(branch(top + 1..kpa.len())? - branch(0..top + 1)?)
}
