//! What the histories of the taxels add to their pressures, and by how much that may be off.

use std::sync::Arc;

use crate::force::tables::{Tables, TaxelReading};

/// One entry per taxel. Cheap to clone, so that snapshots can share it.
#[derive(Clone, Debug)]
pub struct Offsets {
    /// kPa; 0 where hysteresis is not compensated.
    kpa: Arc<[f32]>,
    /// By how much the truth may lie away from that, kPa; `None` as long as every history is known, which is nearly
    /// always. What plays leave of the hysteresis even then is the calibration's to say, and not in here.
    unsure_kpa: Option<Arc<[f32]>>,
}

impl Offsets {
    /// Both have the same length.
    pub const fn new(kpa: Arc<[f32]>, unsure_kpa: Option<Arc<[f32]>>) -> Self {
        Self { kpa, unsure_kpa }
    }

    /// Of how many taxels.
    pub fn taxels(&self) -> usize {
        self.kpa.len()
    }

    /// What the history of a taxel adds to its pressure, kPa.
    pub fn kpa(&self, taxel: usize) -> f32 {
        self.kpa[taxel]
    }

    /// Whether every history is known.
    pub const fn are_known(&self) -> bool {
        self.unsure_kpa.is_none()
    }

    /// Standard uncertainty of the offset because the history is not known, kPa. All taxels under a load have lived through
    /// much the same, so that it is common to them.
    ///
    /// With u the farthest that the truth may lie away: nothing speaks for one place more than for another, so it is a
    /// rectangle. About its middle, from -u to u, where a history is not known, and about its end, from 0 to u, where the offset
    /// lags behind the count. The root mean square of both is u / sqrt(3), and the end of neither is beyond 1.8 of these.
    pub fn sigma_kpa(&self, taxel: usize) -> f64 {
        self.unsure_kpa.as_ref().map_or(0.0, |unsure| f64::from(unsure[taxel]) / 3.0_f64.sqrt())
    }

    fn widened(&self, taxel: usize, reading: TaxelReading) -> TaxelReading {
        if self.are_known() {
            return reading;
        }
        let sigma_kpa = self.sigma_kpa(taxel) as f32;
        TaxelReading {
            sigma_kpa: reading.sigma_kpa.hypot(sigma_kpa),
            shared_kpa: reading.shared_kpa.hypot(sigma_kpa),
            ..reading
        }
    }
}

/// What `count` means for `taxel` with its history, where hysteresis is compensated, and with what is uncertain of that;
/// `None` without a usable model.
pub fn reading(
    tables: &Tables,
    offsets: Option<&Offsets>,
    taxel: usize,
    count: impl Into<u16>,
) -> Option<TaxelReading> {
    let Some(offsets) = offsets else { return tables.reading(taxel, count, 0.0) };
    tables.reading(taxel, count, offsets.kpa(taxel)).map(|reading| offsets.widened(taxel, reading))
}
