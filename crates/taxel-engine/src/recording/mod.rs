//! Whole recordings: the recipe behind `taxeld fit` and `taxeld apply`.
//!
//! What a file allows and a live stream does not: a fault counts from its onset and not from its discovery
//! ([`Masks`]), counts are averaged over scans before and after ([`smooth`]), and a tare is taken back if anything later
//! in the file is lighter than its window ([`Zero`]). The rules for faults and rest are those of the live engine.
//!
//! Why each step is there, measured on a real 280-taxel skin (fitted on one recording, judged on two others): broken
//! taxels and flickering modules left in make the error of the force 43 %, a moved zero 5 to 20 %, a tare under load
//! 80 %; plays halve the error on a branch that was not fitted; the order of the polynomial changes 2 %.

mod apply;
pub(crate) mod course;
mod dropouts;
mod fit;
mod hysteresis;
mod judge;
pub(crate) mod lag;
mod masks;
pub(crate) mod skin_fit;
mod smooth;
#[cfg(test)]
mod tests;
pub(crate) mod zero;

pub use apply::{Applied, ApplyRecipe, Unread, apply};
pub use fit::{Branch, FitRecipe, PlaysChoice, RecordingError, fit};
pub use judge::{Score, judge};
pub use masks::Masks;
pub use smooth::{running_median, smooth};
pub use zero::{Tare, Zero};

use std::ops::Range;
use taxel_model::MIN_BINNED_SAMPLES;

/// A table of counts with so many scans and more, of integers within 0..=255, is a recording of 8-bit taxels.
const SCANS_MIN: u64 = MIN_BINNED_SAMPLES;

/// A recording, column by column; a value that is missing is NaN. All columns are as long as `time_s`.
#[derive(Clone, Debug)]
pub struct Scans<'a> {
    /// Time of each scan, seconds.
    pub time_s: &'a [f64],
    /// What the gauge said at each scan, kPa.
    pub pressure_kpa: Option<&'a [f64]>,
    /// Counts, one column per taxel.
    pub counts: Vec<&'a [f64]>,
}

impl Scans<'_> {
    /// How many scans.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Whether these are 8-bit taxels over time, and not a table of some other two quantities.
    #[must_use]
    pub fn is_recording(&self) -> bool {
        self.len() as u64 >= SCANS_MIN && self.counts.len() > 1 && self.has_bytes()
    }

    fn has_bytes(&self) -> bool {
        let byte = |c: &f64| c.is_nan() || ((0.0..=255.0).contains(c) && c.fract() == 0.0);
        self.counts.iter().all(|column| column.iter().all(byte))
    }

    /// Median time from scan to scan, seconds; 0 if there is none.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        let steps = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        median(steps.collect()).unwrap_or(0.0)
    }

    /// How many scans a span of `seconds` holds, at least one.
    fn scans_in(&self, seconds: f64) -> usize {
        let scans = seconds / self.period_s();
        if scans.is_finite() { (scans as usize).clamp(1, self.len().max(1)) } else { 1 }
    }
}

/// Modules of `size` neighbouring taxels; the last may be smaller.
fn modules(taxels: usize, size: usize) -> Vec<Range<usize>> {
    let size = size.max(1);
    (0..taxels).step_by(size).map(|first| first..(first + size).min(taxels)).collect()
}

/// The value at `share` of the finite values in ascending order; `None` without any.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.retain(|v| v.is_finite());
    let last = values.len().checked_sub(1)?;
    let at = ((share * last as f64).round() as usize).min(last);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// Mean of the finite values and how many they are; NaN without any.
fn mean(values: impl Iterator<Item = f64>) -> (f64, usize) {
    let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0), |(sum, n), v| (sum + v, n + 1));
    (sum / n as f64, n)
}

pub(crate) fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    mean(values.map(|v| v * v)).0.sqrt()
}
