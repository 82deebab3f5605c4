//! From a calibration recording to a model set.

use taxel_model::Workers;

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::Branch;
use crate::calibration::fit::gauge_zero;
use crate::calibration::fit::legs::{self, GAUGE_MEDIAN_SCANS};
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::{FitRecipe, RecordingError};
use crate::calibration::fit::scans::{Scans, modules};
use crate::calibration::fit::skin_fit::{SkinScans, share_gauge};
use crate::calibration::fit::smooth::running_median;
use crate::calibration::fit::zero::{baseline, rest_scans, zero_return};
use crate::calibration::gauge_zero::GaugeZero;
use crate::model_set::{Maker, ModelSet, RecordedTaxel};

/// Fits a recording. The set comes without id, patch and time of making.
///
/// Of 8-bit skin over time what is faulty is left out, and the gauge is set right. Of anything else (counts of other widths
/// or reals, plateaus, typed pressures, few rows) nothing is known of faults or of how fast its counts follow.
///
/// # Errors
/// [`RecordingError`] where nothing can be fitted. A taxel that cannot be is no error: its status says why.
pub fn fit(scans: &Scans<'_>, recipe: &FitRecipe, workers: &dyn Workers) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    let (is_paper, is_skin) = (recipe.is_paper(), scans.is_recording() && !recipe.is_paper());
    let (masks, mut kpa, gauge_zero) = match is_skin {
        true => of_skin(scans, gauge, recipe, workers),
        false => (Masks::missing(scans), gauge.to_vec(), GaugeZero::default()),
    };
    let rises_alone = is_paper || recipe.branch == Branch::Rising;
    if rises_alone {
        let rising = legs::rising(&kpa, &legs::legs(&kpa));
        kpa.iter_mut().zip(rising).filter(|(_, rising)| !rising).for_each(|(p, _)| *p = f64::NAN);
    }
    if is_paper && !kpa.iter().any(|p| p.is_finite()) {
        return Err(RecordingError::NoPressure);
    }
    let smooth_s = if is_skin { recipe.smooth_s } else { 0.0 };
    let mut set = SkinScans { scans, masks: &masks, kpa: &kpa, zeros: None, smooth_s }.fit(recipe, workers)?;
    if smooth_s > 0.0 {
        // A zero of another day is judged by single scans.
        let rest = rest_scans(&kpa);
        for (taxel, zero) in set.baseline.iter_mut().enumerate() {
            let single = baseline(scans.counts[taxel], masks.of(taxel), &rest);
            let both = zero.mean.is_finite() && single.mean.is_finite();
            *zero = if both { TaxelBaseline { noise: single.noise, ..*zero } } else { single };
        }
    }
    let tells = |taxel: &RecordedTaxel| is_skin || taxel.plays.is_some();
    set.recorded.take_if(|recorded| !recorded.taxels.iter().flatten().any(tells));
    if let Some(recorded) = set.recorded.as_mut().filter(|_| is_skin) {
        let usable: Vec<usize> = (0..set.taxels.len()).filter(|&taxel| set.taxels[taxel].is_usable()).collect();
        recorded.zero_return_counts = zero_return(scans, &masks, &kpa, &set.baseline, &usable);
    }
    share_gauge(&mut set, recipe, &gauge_zero, 0.0);
    let branch = if rises_alone { ", rising" } else { "" };
    let method = format!("{}{branch}{}", set.method, gauge_zero.in_words());
    Ok(ModelSet { method, maker: Maker::this(false), ..set })
}

/// What of a skin is faulty, its pressures, and what was taken off these.
fn of_skin(
    scans: &Scans<'_>,
    gauge: &[f64],
    recipe: &FitRecipe,
    workers: &dyn Workers,
) -> (Masks, Vec<f64>, GaugeZero) {
    let modules = modules(scans.counts.len(), recipe.module_size);
    let masks = Masks::find(scans, &modules, &recipe.faults).without_dropouts(scans, workers);
    let mut kpa = running_median(gauge, GAUGE_MEDIAN_SCANS);
    let zero_kpa = gauge_zero::find(scans, &kpa, &masks);
    kpa.iter_mut().for_each(|p| *p -= zero_kpa);
    (masks, kpa, GaugeZero::of_all(zero_kpa))
}
