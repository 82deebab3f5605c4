//! From the counts of a recording to pressures.

use std::fmt;

use taxel_model::{PlayState, Status};

use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::RecordingError;
use crate::calibration::fit::scans::{Scans, modules};
use crate::calibration::fit::smooth::half_width;
use crate::calibration::fit::smooth::smooth;
use crate::calibration::fit::zero::{Tare, Zero};
use crate::intake::faults::limits::FaultLimits;
use crate::model_set::ModelSet;

/// How far taxels move between days, root mean square in counts: what an unproven zero may be off by.
const DAY_COUNTS: f64 = 3.0;

/// How models are applied.
#[derive(Clone, Debug, Default)]
pub struct ApplyRecipe {
    /// What to do about the zero.
    pub tare: Tare,
    /// Counts are averaged over so many seconds; `None` is as the set was fitted.
    pub smooth_s: Option<f64>,
    /// Neighbouring taxels of a module; `None` is as the set was fitted, or 10.
    pub module_size: Option<usize>,
    /// Whether standard deviations are wanted.
    pub sigma: bool,
    /// Limits of the faults.
    pub faults: FaultLimits,
}

/// Why a taxel has no pressure in the whole recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unread {
    /// Its model may not be used.
    Model(Status),
    /// The recording is tared, and the taxel was not sound then.
    NoZero,
    /// It is faulty in every scan.
    Faulty,
}

impl fmt::Display for Unread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Model(status) => write!(f, "no usable model: {}", status.code()),
            Self::NoZero => write!(f, "no zero: faulty while the others were tared"),
            Self::Faulty => write!(f, "faulty in every scan"),
        }
    }
}

/// Pressures of a recording.
#[derive(Clone, Debug)]
pub struct Applied {
    /// One column per taxel, kPa, clamped to the calibrated range; NaN where the taxel is excluded. The column is empty
    /// where it is excluded throughout.
    pub pressure_kpa: Vec<Vec<f64>>,
    /// Their standard deviations, kPa, likewise; all empty if they were not wanted.
    pub sigma_kpa: Vec<Vec<f64>>,
    /// Why a column is empty.
    pub unread: Vec<Option<Unread>>,
    /// What was done about the zero.
    pub zero: Zero,
    /// Scans of readable taxels that are excluded as faulty, and all of them.
    pub masked: (usize, usize),
}

/// Applies a model set. Faulty stretches are left out.
///
/// # Errors
/// [`RecordingError::Taxels`] if set and recording do not have the same number.
pub fn apply(scans: &Scans<'_>, set: &ModelSet, recipe: &ApplyRecipe) -> Result<Applied, RecordingError> {
    let (recorded, models) = (scans.counts.len(), set.taxels.len());
    if recorded != models {
        return Err(RecordingError::Taxels { recorded, models });
    }
    let module_size = recipe.module_size.or(set.recorded.as_ref().map(|r| r.module_size)).unwrap_or(10);
    // Anything but several 8-bit taxels is a table of numbers: nothing is known of its faults or its rest.
    let skin = scans.has_bytes() && recorded > 1;
    let masks =
        if skin { Masks::find(scans, &modules(recorded, module_size), &recipe.faults) } else { Masks::missing(scans) };
    let zero = Zero::find(recipe.tare, scans, &masks, set, module_size);
    let smooth_s = recipe.smooth_s.or(set.recorded.as_ref().map(|r| r.smooth_s)).unwrap_or(0.0);
    let mut applied = Applied {
        pressure_kpa: vec![Vec::new(); models],
        sigma_kpa: vec![Vec::new(); models],
        unread: vec![None; models],
        zero,
        masked: (0, 0),
    };
    let reader = Reader { set, half: half_width(scans, smooth_s), sigma: recipe.sigma };
    for (taxel, counts) in scans.counts.iter().enumerate() {
        match reader.readable(taxel, &applied.zero, &masks) {
            Err(why) => applied.unread[taxel] = Some(why),
            Ok(moved) => {
                let masked = masks.of(taxel);
                applied.masked.0 += masked.iter().filter(|m| **m).count();
                applied.masked.1 += masked.len();
                let tared = applied.zero.is_tared();
                let (kpa, sigma) = reader.column(taxel, counts, masked, moved, tared);
                applied.pressure_kpa[taxel] = kpa;
                applied.sigma_kpa[taxel] = sigma;
            }
        }
    }
    Ok(applied)
}

struct Reader<'a> {
    set: &'a ModelSet,
    half: usize,
    sigma: bool,
}

impl Reader<'_> {
    /// By how many counts the taxel's zero has moved, or why it cannot be read.
    fn readable(&self, taxel: usize, zero: &Zero, masks: &Masks) -> Result<f64, Unread> {
        let model = &self.set.taxels[taxel];
        if !model.is_usable() {
            return Err(Unread::Model(model.status));
        }
        if masks.of(taxel).iter().all(|m| *m) {
            return Err(Unread::Faulty);
        }
        zero.moved(taxel).ok_or(Unread::NoZero)
    }

    /// Pressures and standard deviations of a taxel.
    fn column(&self, taxel: usize, counts: &[f64], masked: &[bool], moved: f64, tared: bool) -> (Vec<f64>, Vec<f64>) {
        let model = &self.set.taxels[taxel];
        let recorded = self.set.recorded.as_ref();
        let in_use = recorded.and_then(|r| r.taxels.get(taxel)).and_then(Option::as_ref);
        let plays = in_use.and_then(|taxel| taxel.plays.as_ref());
        let zero_counts = recorded.map_or(0.0, |r| r.zero_return_counts).hypot(if tared { 0.0 } else { DAY_COUNTS });
        let in_use_sigma = in_use.map(|taxel| taxel.sigma_kpa(zero_counts));
        let smoothed = smooth(counts, masked, self.half);
        let mut state = PlayState::default();
        let mut kpa = vec![f64::NAN; counts.len()];
        let mut sigma = vec![f64::NAN; if self.sigma { counts.len() } else { 0 }];
        for i in (0..counts.len()).filter(|&i| !masked[i]) {
            let count = smoothed[i] - moved;
            let Some(reading) = model.evaluate(count) else { continue };
            kpa[i] = plays.map_or(reading.kpa, |plays| plays.evaluate(&mut state, count));
            if self.sigma {
                sigma[i] = in_use_sigma.unwrap_or(reading.sigma_kpa);
            }
        }
        (kpa, sigma)
    }
}
