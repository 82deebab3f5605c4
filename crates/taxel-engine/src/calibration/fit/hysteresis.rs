//! How far the falling branch lies from the rising one, and whether plays earn their place.

use std::ops::Range;

use taxel_model::{Order, PLAYS, PlayState, Plays, RADII_OF_SWING};

use crate::statistics::{mean, root_mean_square, spread};

/// Pressures, as shares of the range, between which the width is measured: at the ends both branches meet.
const WIDTH_BETWEEN: (f64, f64) = (0.1, 0.85);

/// Fewest samples of a branch for a mean.
const SAMPLES_MIN: usize = 20;

/// The swing of a smoothed count between its 0.2 and 99.8 % points.
pub(super) fn swing(smoothed: &[f64], kpa: &[f64]) -> Option<f64> {
    let known = smoothed.iter().zip(kpa).filter(|(_, p)| p.is_finite()).map(|(c, _)| *c);
    let [low, high] = spread(known, [0.002, 0.998])?;
    Some(high - low).filter(|swing| *swing > 0.0)
}

/// The least and the greatest of the finite values; infinite without any.
pub(super) fn range(values: &[f64]) -> [f64; 2] {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)]
}

/// Plays of one taxel over the scans with a pressure.
pub(super) fn identify(smoothed: &[f64], kpa: &[f64], order: Order) -> Option<Plays> {
    let swing = swing(smoothed, kpa)?;
    Plays::identify_of_order(smoothed, kpa, RADII_OF_SWING.map(|share| share * swing), order)
}

/// Root mean square errors on the scans `held_out`, kPa: of plays fitted to `seen`, the pressures without those, and of
/// their curve alone.
pub(super) fn held_out_errors(
    smoothed: &[f64],
    seen: &[f64],
    kpa: &[f64],
    held_out: &Range<usize>,
    order: Order,
) -> Option<(f64, f64)> {
    let error = |plays: &Plays| error_on(&read(plays, smoothed), kpa, held_out);
    let alone = Plays::identify_of_order(smoothed, seen, [0.0; PLAYS], order)?;
    Some((error(&identify(smoothed, seen, order)?), error(&alone)))
}

/// Root mean square of what is read less `kpa` over some scans.
pub(super) fn error_on(read: &[f64], kpa: &[f64], scans: &Range<usize>) -> f64 {
    root_mean_square(scans.clone().filter_map(|i| Some(read.get(i)? - kpa.get(i)?)))
}

/// The pressures that plays make of a smoothed count; NaN where there is none.
pub(super) fn read(plays: &Plays, smoothed: &[f64]) -> Vec<f64> {
    let mut state = PlayState::default();
    smoothed.iter().map(|&count| plays.evaluate(&mut state, count)).collect()
}

/// How much lower the gauge is at equal counts while the pressure falls, kPa: the mean of what the static curve reads
/// too high on the falling branch, less that on the rising one.
pub(super) fn width_kpa(static_read: &[f64], kpa: &[f64], falling: &[bool]) -> Option<f64> {
    let [low, high] = range(kpa);
    let between = |p: f64| {
        let share = (p - low) / (high - low);
        share >= WIDTH_BETWEEN.0 && share <= WIDTH_BETWEEN.1
    };
    let branch = |wanted: bool| {
        let pairs = static_read.iter().zip(kpa).zip(falling);
        let pairs = pairs.filter(|((_, p), falling)| **falling == wanted && between(**p));
        let (mean, n) = mean(pairs.map(|((read, p), _)| read - p));
        (n >= SAMPLES_MIN).then_some(mean)
    };
    Some(branch(true)? - branch(false)?)
}
