//! From a calibration recording to a model set.

use std::ops::Range;

use taxel_model::Workers;

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::Branch;
use crate::calibration::fit::gauge_zero;
use crate::calibration::fit::legs::{self, GAUGE_MEDIAN_SCANS};
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::paper;
use crate::calibration::fit::recipe_options::{FitRecipe, RecordingError};
use crate::calibration::fit::scans::{Scans, modules};
use crate::calibration::fit::skin_fit::SkinScans;
use crate::calibration::fit::smooth::running_median;
use crate::calibration::fit::zero::{baseline, rest_scans, zero_return};
use crate::calibration::gauge_zero::steeper_at_rest;
use crate::model_set::{Maker, ModelSet, Recorded, RecordedTaxel};

/// Fits a recording. The set comes without id, patch and time of making.
///
/// Of 8-bit skin over time what is faulty is left out, and the gauge is set right. Of anything else (counts of other widths
/// or reals, plateaus, typed pressures, few rows) nothing is known of faults or of how fast its counts follow.
///
/// # Errors
/// [`RecordingError`] where nothing can be fitted. A taxel that cannot be is no error: its status says why.
pub fn fit(scans: &Scans<'_>, recipe: &FitRecipe, workers: &dyn Workers) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    if recipe.is_paper() {
        return paper::fit(scans, gauge, recipe, workers);
    }
    let is_skin = scans.is_recording();
    let Prepared { masks, mut kpa, gauge_zero_kpa } =
        if is_skin { Prepared::of_skin(scans, gauge, recipe, workers) } else { Prepared::of_table(scans, gauge) };
    let rises_alone = recipe.branch == Branch::Rising;
    if rises_alone {
        let rising = legs::rising(&kpa, &legs::legs(&kpa));
        kpa.iter_mut().zip(rising).filter(|(_, rising)| !rising).for_each(|(p, _)| *p = f64::NAN);
    }
    let smooth_s = if is_skin { recipe.smooth_s } else { 0.0 };
    let mut fitted = SkinScans { scans, masks: &masks, kpa: &kpa, zeros: None, smooth_s }.fit(recipe, workers)?;
    if smooth_s > 0.0 {
        // A zero of another day is judged by single scans.
        let rest = rest_scans(&kpa);
        for (taxel, zero) in fitted.zeros.iter_mut().enumerate() {
            let single = baseline(scans.counts[taxel], masks.of(taxel), &rest);
            let both = zero.mean.is_finite() && single.mean.is_finite();
            *zero = if both { TaxelBaseline { noise: single.noise, ..*zero } } else { single };
        }
    }
    let usable: Vec<usize> = (0..fitted.models.len()).filter(|&taxel| fitted.models[taxel].is_usable()).collect();
    let tells = |taxel: &RecordedTaxel| is_skin || taxel.plays.is_some();
    let recorded = fitted.in_use.iter().flatten().any(tells).then(|| Recorded {
        smooth_s,
        plays_mean_s: fitted.plays_mean_s,
        module_size: recipe.module_size,
        zero_return: if is_skin { zero_return(scans, &masks, &kpa, &fitted.zeros, &usable) } else { None },
        plays_error_ratio: fitted.plays_error_ratio,
        taxels: fitted.in_use,
    });
    // As of a session: a gauge that is off and a chamber that was not vented look the same.
    let doubt_kpa = gauge_zero_kpa.abs() / 3.0_f64.sqrt() * steeper_at_rest(&fitted.models, &fitted.zeros);
    let offset_kpa = recipe.options.gauge.offset_kpa.hypot(doubt_kpa);
    fitted.models.iter_mut().for_each(|model| model.gauge.offset_kpa = offset_kpa);
    let branch = if rises_alone { ", rising" } else { "" };
    let gauge_zero = match gauge_zero_kpa {
        0.0 => String::new(),
        zero_kpa => format!(", less {zero_kpa:.2} kPa that the gauge reads at rest"),
    };
    Ok(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: format!("{}{branch}{gauge_zero}", fitted.method),
        board_settings: Vec::new(),
        baseline: fitted.zeros,
        pressure_max_kpa: fitted.pressure_max_kpa,
        gauge_gain_rel: recipe.options.gauge.gain_rel,
        gauge_offset_kpa: offset_kpa,
        taxels: fitted.models,
        recorded,
        recalibrated: None,
        maker: Maker::this(false),
    })
}

/// What a recording is before it is fitted.
struct Prepared {
    masks: Masks,
    kpa: Vec<f64>,
    gauge_zero_kpa: f64,
}

impl Prepared {
    fn of_table(scans: &Scans<'_>, gauge: &[f64]) -> Self {
        Self { masks: Masks::missing(scans), kpa: gauge.to_vec(), gauge_zero_kpa: 0.0 }
    }

    fn of_skin(scans: &Scans<'_>, gauge: &[f64], recipe: &FitRecipe, workers: &dyn Workers) -> Self {
        let modules: Vec<Range<usize>> = modules(scans.counts.len(), recipe.module_size);
        let masks = Masks::find(scans, &modules, &recipe.faults).without_dropouts(scans, workers);
        let mut kpa = running_median(gauge, GAUGE_MEDIAN_SCANS);
        let gauge_zero_kpa = gauge_zero::find(scans, &kpa, &masks);
        kpa.iter_mut().for_each(|p| *p -= gauge_zero_kpa);
        Self { masks, kpa, gauge_zero_kpa }
    }
}
