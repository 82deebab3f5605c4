//! Single readings that stand alone: a converter that missed once.
//!
//! The live faults leave them, because a single blow is no flicker and a touch may come between two scans. A fit knows
//! what came after, and one such reading can bend a curve by kilopascals.

use crate::statistics::{MEDIAN_DEVIATIONS, quantile};

/// Scans on each side that a reading is compared with (Hampel identifier; Pearson 2002).
const REACH: usize = 7;

/// A reading further from the median than so many standard deviations, estimated from the median deviation, ...
const DEVIATIONS: f64 = 5.0;

/// ... and than so many counts stands alone.
const FLOOR_COUNTS: f64 = 3.0;

/// Where readings stand alone, among those that are finite and not masked; ascending.
pub(super) fn dropouts(counts: &[f64], masked: &[bool]) -> Vec<usize> {
    let sound: Vec<usize> = (0..counts.len()).filter(|&i| !masked[i] && counts[i].is_finite()).collect();
    // One sort of a window costs more than everything else; so only a reading that jumps is looked at.
    let jumps = |a: usize, b: usize| (counts[sound[a]] - counts[sound[b]]).abs() > FLOOR_COUNTS;
    let jumps_at = |at: usize| (at > 0 && jumps(at, at - 1)) || (at + 1 < sound.len() && jumps(at, at + 1));
    let alone = (0..sound.len()).filter(|&at| jumps_at(at)).filter(|&at| {
        let around = &sound[at.saturating_sub(REACH)..sound.len().min(at + REACH + 1)];
        let Some(middle) = quantile(around.iter().map(|&i| counts[i]).collect(), 0.5) else { return false };
        let deviation = quantile(around.iter().map(|&i| (counts[i] - middle).abs()).collect(), 0.5).unwrap_or(0.0);
        (counts[sound[at]] - middle).abs() > (DEVIATIONS * MEDIAN_DEVIATIONS * deviation).max(FLOOR_COUNTS)
    });
    alone.map(|at| sound[at]).collect()
}
