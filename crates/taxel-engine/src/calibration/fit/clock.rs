//! A gauge that another logger has recorded has a clock of its own: found, told, and used where it wins unseen.

use std::ops::Range;

use taxel_model::{ClockProblem, FoundClock};

use crate::calibration::fit::course::Course;
use crate::calibration::fit::lag::{mean_counts, shifted_to};
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::scans::Scans;
use crate::calibration::fit::smooth::{half_width, smooth};
use crate::model_set::GaugeClock;

/// Counts are averaged over so many seconds: plays take noise for motion.
const SMOOTH_S: f64 = 0.5;

/// Looks for the clock within `max_s`; `None` where none can be told, as without a falling branch that can judge it.
pub(super) fn find(scans: &Scans<'_>, kpa: &[f64], masks: &Masks, course: &Course, max_s: f64) -> Option<FoundClock> {
    let held_out = course.held_out(kpa)?;
    let counts = mean_counts(scans, masks);
    let counts = smooth(&counts, &vec![false; counts.len()], half_width(scans, SMOOTH_S));
    ClockProblem { time_s: scans.time_s, counts: &counts, pressure_kpa: kpa, max_s }.find(&held_out)
}

/// The pressure that belongs to each scan under a clock; NaN beyond the gauge's readings.
pub(super) fn set_right(time_s: &[f64], kpa: &[f64], clock: &FoundClock) -> Vec<f64> {
    let whole: Range<usize> = 0..time_s.len();
    shifted_to(time_s, kpa, &|t| clock.gauge_time_s(t), std::slice::from_ref(&whole))
}

/// What is told of it.
pub(super) const fn told(clock: &FoundClock) -> GaugeClock {
    let FoundClock { offset_s, rate, error_ratio, wins: applied, .. } = *clock;
    GaugeClock { offset_s, rate, error_ratio, applied }
}
