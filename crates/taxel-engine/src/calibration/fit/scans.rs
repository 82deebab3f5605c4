//! A recording, column by column.

use std::ops::Range;

use crate::statistics::quantile;

/// A table of counts with so many scans and more, of integers within 0..=255, is a recording of 8-bit taxels; a session with fewer
/// is not fitted.
pub const RECORDING_SCANS_MIN: usize = 280;

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
        self.len() >= RECORDING_SCANS_MIN && self.counts.len() > 1 && self.has_bytes()
    }

    pub(crate) fn has_bytes(&self) -> bool {
        self.counts.iter().all(|column| column.iter().all(|c| c.is_nan() || is_byte(*c)))
    }

    /// Median time from scan to scan, seconds; 0 if there is none.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        let steps = self.time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
        quantile(steps.collect(), 0.5).unwrap_or(0.0)
    }

    /// How many scans a span of `seconds` holds, at least one.
    pub(crate) fn scans_in(&self, seconds: f64) -> usize {
        let scans = seconds / self.period_s();
        if scans.is_finite() { (scans as usize).clamp(1, self.len().max(1)) } else { 1 }
    }
}

/// Whether a value is an 8-bit count. Many millions are asked, and `fract` is a call of the mathematical library.
#[must_use]
pub fn is_byte(value: f64) -> bool {
    f64::from(value as u8) == value
}

/// Modules of `size` neighbouring taxels; the last may be smaller.
pub(crate) fn modules(taxels: usize, size: usize) -> Vec<Range<usize>> {
    let size = size.max(1);
    (0..taxels).step_by(size).map(|first| first..(first + size).min(taxels)).collect()
}
