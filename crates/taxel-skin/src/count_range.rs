//! How wide the counts of a skin are, and what one unit of them is.
//!
//! Everything that is judged in counts (noise, thresholds, drift) was measured on converters of eight bits. A finer one
//! divides the same range into more counts, so a **unit** is a 256th of the range: one count of eight bits or fewer, 16
//! counts of twelve bits. Baselines, limits and models are in units; raw counts are what a sensor sent.

/// Units in the range of a converter of eight bits or more.
const UNITS: f64 = 256.0;

/// The range of the raw counts of a skin: 0 to `top`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CountRange {
    top: u16,
}

impl CountRange {
    /// Counts of eight bits, as those of iCub's boards.
    pub const BYTE: Self = Self { top: 255 };

    /// Counts from 0 to `top`; `None` if there is no other count than 0.
    #[must_use]
    pub const fn to(top: u16) -> Option<Self> {
        if top == 0 { None } else { Some(Self { top }) }
    }

    /// The greatest raw count.
    #[must_use]
    pub const fn top(self) -> u16 {
        self.top
    }

    /// Whether a count fits into a byte; a unit is one count then.
    #[must_use]
    pub const fn is_byte(self) -> bool {
        self.top <= 255
    }

    /// Raw counts in a unit: 1 up to eight bits, a 256th of the range beyond.
    #[must_use]
    pub fn per_unit(self) -> f64 {
        if self.is_byte() { 1.0 } else { (f64::from(self.top) + 1.0) / UNITS }
    }

    /// A raw count in units.
    #[must_use]
    pub fn units(self, raw: u16) -> f64 {
        f64::from(raw) / self.per_unit()
    }

    /// The raw count nearest to so many units, within the range.
    #[must_use]
    pub fn nearest(self, units: f64) -> u16 {
        // The cast makes NaN zero and is bounded before.
        (units * self.per_unit()).round().clamp(0.0, f64::from(self.top)) as u16
    }
}

impl Default for CountRange {
    fn default() -> Self {
        Self::BYTE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_a_count_up_to_eight_bits_and_a_256th_of_the_range_beyond() {
        let per_unit = |top| CountRange::to(top).unwrap().per_unit();
        assert_eq!([15, 255, 1023, 4095, 65_535].map(per_unit), [1.0, 1.0, 4.0, 16.0, 256.0]);
        assert_eq!(CountRange::to(0), None);
    }

    #[test]
    fn every_raw_count_comes_back_from_its_units() {
        for top in [1, 255, 256, 1_000, 4_095, 50_000, 65_535] {
            let range = CountRange::to(top).unwrap();
            assert!((0..=top).all(|raw| range.nearest(range.units(raw)) == raw), "{top}");
            assert_eq!([range.nearest(-1.0), range.nearest(f64::NAN), range.nearest(1e9)], [0, 0, top]);
        }
    }
}
