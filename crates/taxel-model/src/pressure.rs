//! Pressures as integers, so that their sums are exact.

/// Units of 2^-10 Pa in a kilopascal.
pub(crate) const UNITS_PER_KPA: f64 = 1_024_000.0;

/// Pressures beyond this are refused, kPa: it bounds the number of bins and keeps every sum far from overflow.
const MAX_KPA: f64 = 1000.0;

/// A pressure as an integer number of 2^-10 Pa, within +-1000 kPa.
///
/// The rounding, at most 0.0005 Pa, is far below any gauge; in return every sum is exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FixedPressure(i32);

impl FixedPressure {
    /// `None` if `kpa` is not finite or beyond +-1000 kPa.
    #[must_use]
    pub fn from_kpa(kpa: f64) -> Option<Self> {
        (kpa.abs() <= MAX_KPA).then(|| Self((kpa * UNITS_PER_KPA).round() as i32))
    }

    /// The pressure in kPa.
    #[must_use]
    pub fn to_kpa(self) -> f64 {
        f64::from(self.0) / UNITS_PER_KPA
    }

    /// The number of units of 2^-10 Pa.
    #[inline]
    pub(crate) const fn units(self) -> i32 {
        self.0
    }
}
