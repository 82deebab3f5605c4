//! A model as a table over the 256 raw 8-bit counts: one load a reading in the live path.

use crate::model::{RangeState, TaxelModel};

/// Pressure and standard deviation for each raw count.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Pressure, kPa, at the raw count that is the index.
    pub pressure_kpa: [f32; 256],
    /// Standard deviation of one reading, kPa, quantisation included; infinite if unknown.
    pub sigma_kpa: [f32; 256],
    /// Least and greatest raw count within the calibrated range; `None` if the shift leaves none.
    pub range: Option<(u8, u8)>,
    /// Whether the model's status allows its use. An unusable table holds zeros, and infinite deviations.
    pub usable: bool,
}

impl Table {
    /// Where a raw count lies; without a range everything is below it.
    #[must_use]
    pub fn range_state(&self, raw: u8) -> RangeState {
        match self.range {
            Some((low, high)) if raw >= low => {
                if raw <= high {
                    RangeState::InRange
                } else {
                    RangeState::Above
                }
            }
            _ => RangeState::Below,
        }
    }
}

impl TaxelModel {
    /// The model at raw count + `shift_counts`, where the shift is what the tare says the zero has moved by since the
    /// calibration. Counts that land outside the calibrated range hold the value at its end.
    #[must_use]
    pub fn tabulate(&self, shift_counts: f64) -> Table {
        let mut table =
            Table { pressure_kpa: [0.0; 256], sigma_kpa: [f32::INFINITY; 256], range: None, usable: self.is_usable() };
        let (Some(curve), Some([low, high])) = (self.served(), self.range) else { return table };
        if !shift_counts.is_finite() || !table.usable {
            table.usable = false;
            return table;
        }
        let quantum = 1.0 / 12.0_f64.sqrt();
        // Beyond an end of the range every count reads the same: worked out once.
        let mut end: Option<(RangeState, f32, f32)> = None;
        for raw in 0..=u8::MAX {
            let count = f64::from(raw) + shift_counts;
            let (kpa, sigma_kpa) = match end {
                Some((RangeState::Below, kpa, sigma_kpa)) if count < low => (kpa, sigma_kpa),
                Some((RangeState::Above, kpa, sigma_kpa)) => (kpa, sigma_kpa),
                _ => {
                    let Some(reading) = self.evaluate(count) else { continue };
                    let floor = curve.slope(count.max(low).min(high)).abs() * quantum;
                    let entry = (reading.kpa as f32, reading.sigma_kpa.max(floor) as f32);
                    match reading.range {
                        RangeState::InRange => table.range = Some((table.range.map_or(raw, |range| range.0), raw)),
                        beyond => end = Some((beyond, entry.0, entry.1)),
                    }
                    entry
                }
            };
            table.pressure_kpa[usize::from(raw)] = kpa;
            table.sigma_kpa[usize::from(raw)] = sigma_kpa;
        }
        table
    }
}
