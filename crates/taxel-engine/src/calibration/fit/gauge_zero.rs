//! What the gauge of a recording says while nothing presses: its own zero.
//!
//! Before the pressure comes, both sides of the skin have the same one, and a gauge that reads something then is off by as
//! much. A curve that was fitted to such readings reads as much too high at every count, and all day: at rest, where a tared
//! skin bears nothing, it would read the gauge's error. So the error is taken off, where the beginning of the recording
//! shows that nothing moves.

use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::scans::Scans;
use crate::calibration::fit::zero::rest_limit_kpa;
use crate::statistics::mean;

/// The beginning that may show it, seconds.
const WINDOW_S: f64 = 2.0;

/// Fewest scans of it with a pressure.
const SCANS_MIN: usize = 20;

/// From one half of the beginning to the other the gauge may move by this share of what it reads: a ramp from nothing
/// moves by all of it.
const MOVES_MAX_SHARE: f64 = 0.1;

/// And the mean count by so much, counts: its noise is a fiftieth of that.
const MOVES_MAX_COUNTS: f64 = 0.1;

/// More is no gauge's zero but a pressure, kPa: sessions are refused from there on, too.
const ZERO_MAX_KPA: f64 = 10.0;

/// Largest share of masked scans of a taxel whose counts tell.
const MASKED_MAX: f64 = 0.01;

/// The gauge's zero, kPa; 0 where the recording does not begin at rest.
pub(super) fn find(scans: &Scans<'_>, kpa: &[f64], masks: &Masks) -> f64 {
    let n = scans.scans_in(WINDOW_S).min(kpa.len());
    let half = |values: &[f64], second: bool| {
        let values = if second { &values[n / 2..n] } else { &values[..n / 2] };
        mean(values.iter().copied().filter(|value| value.is_finite()))
    };
    let moved = |values: &[f64]| half(values, true).0 - half(values, false).0;
    let (zero, known) = mean(kpa[..n].iter().copied().filter(|p| p.is_finite()));
    let still =
        moved(kpa).abs() <= MOVES_MAX_SHARE * zero.abs() && moved(&mean_counts(scans, masks)).abs() <= MOVES_MAX_COUNTS;
    let plausible = zero.abs() <= ZERO_MAX_KPA && zero <= rest_limit_kpa(kpa);
    if known >= SCANS_MIN && still && plausible { zero } else { 0.0 }
}

/// Mean count of the taxels that are sound nearly throughout, one per scan; NaN without any.
fn mean_counts(scans: &Scans<'_>, masks: &Masks) -> Vec<f64> {
    let sound: Vec<usize> = (0..scans.counts.len()).filter(|&t| masks.share(t) <= MASKED_MAX).collect();
    (0..scans.len()).map(|i| mean(sound.iter().map(|&t| scans.counts[t][i])).0).collect()
}
