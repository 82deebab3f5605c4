//! From the counts of a recording to pressures.

use std::borrow::Cow;

use taxel_model::{Beyond, Extension, PlayState, RangeState, Sign};

use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::RecordingError;
use crate::calibration::fit::scans::{Scans, modules};
use crate::calibration::fit::smooth::half_width;
use crate::calibration::fit::smooth::{recent_means, smooth};
use crate::calibration::fit::zero::{Tare, Zero};
use crate::intake::faults::limits::FaultLimits;
use crate::model_set::{GAIN_OF_DAY_REL, GAIN_OF_RECORDING_REL, ModelSet};

/// How far taxels move between days, root mean square in counts: what an unproven zero may be off by.
const DAY_COUNTS: f64 = 3.0;

/// Pressures of a recording.
#[derive(Clone, Debug)]
pub struct Applied {
    /// One per taxel; or why it is excluded throughout, in words.
    pub columns: Vec<Result<Column, String>>,
    /// What was done about the zero.
    pub zero: Zero,
    /// Scans of readable taxels that are excluded as faulty, and all of them.
    pub masked: (usize, usize),
}

/// What one taxel reads, scan by scan; NaN where it is excluded.
#[derive(Clone, Debug)]
pub struct Column {
    /// Pressures, kPa, beyond the calibrated range of a skin extended (see [`taxel_model::SkinSlope`]).
    pub kpa: Vec<f64>,
    /// Their standard deviations, kPa. Infinite at an end of the converter towards pressure, and beyond the calibrated range of
    /// what is no skin: there the reading is a lower bound only.
    pub sigma_kpa: Vec<f64>,
    /// Whether a reading is of more pressure than was calibrated.
    pub beyond: Vec<bool>,
}

/// Applies a model set with this zero. Faulty stretches are left out.
///
/// # Errors
/// [`RecordingError::Taxels`] if set and recording do not have the same number, [`RecordingError::TareTooLong`] if the zero
/// is to be taken from more than is recorded.
pub fn apply(scans: &Scans<'_>, set: &ModelSet, tare: Tare) -> Result<Applied, RecordingError> {
    let (recorded, models) = (scans.counts.len(), set.taxels.len());
    if recorded != models {
        return Err(RecordingError::Taxels { recorded, models });
    }
    let span_s = scans.time_s.last().zip(scans.time_s.first()).map_or(0.0, |(last, first)| last - first);
    if let Tare::Seconds(tare_s) = tare
        && tare_s > span_s + scans.period_s()
    {
        return Err(RecordingError::TareTooLong { tare_s, span_s });
    }
    let (module_size, smooth_s) = set.recorded.as_ref().map_or((10, 0.0), |of| (of.module_size, of.smooth_s));
    // Of anything but several 8-bit taxels over time nothing is known of faults or rest.
    let skin = scans.is_recording() || set.is_of_skin() && scans.has_bytes() && recorded > 1;
    let find = || Masks::find(scans, &modules(recorded, module_size), &FaultLimits::default());
    let masks = if skin { find() } else { Masks::missing(scans) };
    let tare = if tare == Tare::Auto && !skin { Tare::None } else { tare };
    let zero = Zero::find(tare, scans, &masks, set, module_size);
    let one_skin = skin || set.taxels.iter().any(|model| model.points.is_some());
    let extensions = if one_skin { set.extensions() } else { vec![None; models] };
    let curve_sigmas_kpa = if skin { set.curve_sigmas_kpa() } else { vec![0.0; models] };
    let reader = Reader {
        set,
        extensions,
        curve_sigmas_kpa,
        half: half_width(scans, smooth_s),
        period_s: scans.period_s(),
        skin,
        tared: zero.moved.is_some(),
    };
    let mut masked = (0, 0);
    let column = |(taxel, counts): (usize, &&[f64])| {
        let moved = reader.readable(taxel, &zero, &masks)?;
        let of = masks.of(taxel);
        masked = (masked.0 + of.iter().filter(|m| **m).count(), masked.1 + of.len());
        Ok(reader.column(taxel, counts, of, moved))
    };
    let columns = scans.counts.iter().enumerate().map(column).collect();
    Ok(Applied { columns, zero, masked })
}

struct Reader<'a> {
    set: &'a ModelSet,
    extensions: Vec<Option<Extension>>,
    /// What the calibration leaves open, kPa, by taxel.
    curve_sigmas_kpa: Vec<f64>,
    half: usize,
    period_s: f64,
    skin: bool,
    tared: bool,
}

impl Reader<'_> {
    /// By how many counts the taxel's zero has moved, or why it cannot be read.
    fn readable(&self, taxel: usize, zero: &Zero, masks: &Masks) -> Result<f64, String> {
        let model = &self.set.taxels[taxel];
        if !model.is_usable() {
            return Err(format!("no usable model: {}", model.status.code()));
        }
        if masks.of(taxel).iter().all(|m| *m) {
            return Err("faulty in every scan".to_owned());
        }
        let known = self.set.baseline.get(taxel).is_some_and(|rest| rest.mean.is_finite());
        let lacks = || match known {
            true => "no zero: faulty while the others were tared".to_owned(),
            false => "no zero: the models have no unloaded count of it; --tare none leaves theirs".to_owned(),
        };
        zero.moved(taxel).ok_or_else(lacks)
    }

    /// What a reading of a taxel is uncertain by because of its zero, kPa.
    fn zero_sigma_kpa(&self, taxel: usize) -> f64 {
        let Some((recorded, in_use)) = self.set.recorded.as_ref().zip(self.set.in_use(taxel)) else { return 0.0 };
        // What is not known may all be common, and the zero of another day mostly is.
        let day = if self.tared || !self.skin { 0.0 } else { DAY_COUNTS };
        // A tare finds the skin anywhere between its zero and where the last load has left it: a rectangle.
        (recorded.zero_return_counts.unwrap_or(0.0) / 3.0_f64.sqrt()).hypot(day) / in_use.sensitivity
    }

    /// Pressures of a taxel with their uncertainty.
    fn column(&self, taxel: usize, counts: &[f64], masked: &[bool], moved: f64) -> Column {
        let (model, plays) = (&self.set.taxels[taxel], self.set.plays(taxel));
        let (zero_kpa, curve_sigma_kpa, extension) =
            (self.zero_sigma_kpa(taxel), self.curve_sigmas_kpa[taxel], self.extensions[taxel]);
        let sign = plays.map_or(model.sign, |plays| plays.sign);
        let rail = if sign == Sign::Falling { 0.0 } else { 255.0 };
        // What corrected a set by known loads is in these, too.
        let of_day = match plays {
            _ if self.skin => GAIN_OF_DAY_REL,
            Some(_) => GAIN_OF_RECORDING_REL,
            None => 0.0,
        };
        let gain = of_day.hypot(self.set.gauge_gain_rel);
        let smoothed = smooth(counts, masked, self.half);
        let felt = self.set.recorded.as_ref().filter(|recorded| recorded.plays_mean_s > 0.0 && plays.is_some());
        let felt = felt.map_or(Cow::Borrowed(&smoothed), |recorded| {
            Cow::Owned(recent_means(&smoothed, masked, (recorded.plays_mean_s / self.period_s).round() as usize))
        });
        let mut state = PlayState::default();
        let (kpa, sigma_kpa) = (vec![f64::NAN; counts.len()], vec![f64::NAN; counts.len()]);
        let mut column = Column { kpa, sigma_kpa, beyond: vec![false; counts.len()] };
        for i in (0..counts.len()).filter(|&i| !masked[i]) {
            let count = smoothed[i] - moved;
            let Some(reading) = model.evaluate(count) else { continue };
            let beyond = extension.map_or(Beyond::default(), |extension| extension.at(count));
            let bend_kpa = plays.map_or(0.0, |plays| plays.bend_kpa(&mut state, felt[i] - moved));
            let kpa = reading.kpa + bend_kpa + beyond.kpa;
            // Left-out readings of a skin fit show what the calibration leaves open, too.
            let in_sigma = if model.points.is_some() { curve_sigma_kpa.min(reading.sigma_kpa) } else { 0.0 };
            let own_kpa = (reading.sigma_kpa.powi(2) - in_sigma.powi(2)).sqrt();
            let range = plays.map_or(reading.range, |plays| RangeState::of(count, plays.range)).in_pressure(sign);
            // Nothing tells how much more than at the range's end it is.
            let is_open = self.skin && counts[i] == rail || extension.is_none() && range == RangeState::Above;
            // Anything from there to nothing.
            let before_kpa = if range == RangeState::Below { kpa } else { 0.0 };
            column.kpa[i] = kpa;
            let parts =
                [zero_kpa, curve_sigma_kpa, beyond.sigma_kpa(), gain * kpa, self.set.gauge_offset_kpa, before_kpa];
            let sigma_kpa = parts.into_iter().fold(own_kpa, f64::hypot);
            column.sigma_kpa[i] = if is_open { f64::INFINITY } else { sigma_kpa };
            column.beyond[i] = beyond.sigma_kpa() > 0.0 || is_open;
        }
        column
    }
}

#[cfg(test)]
#[path = "apply_tests.rs"]
mod tests;
