//! The paper's fit: its equation over all samples of rising pressure, as they are. No fault is looked for, nothing is averaged,
//! shifted in time or compensated.

use taxel_model::{FitOptions, Samples, TaxelModel, Workers, map};

use crate::baseline::TaxelBaseline;
use crate::calibration::fit::legs::{legs, rising};
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::{FitRecipe, RecordingError};
use crate::calibration::fit::scans::Scans;
use crate::calibration::fit::zero::{baseline, rest_scans};
use crate::model_set::{Maker, ModelSet};

/// Fits a recording. The set comes without id, patch and time of making.
pub(super) fn fit(
    scans: &Scans<'_>,
    kpa: &[f64],
    recipe: &FitRecipe,
    workers: &dyn Workers,
) -> Result<ModelSet, RecordingError> {
    let known = (0..kpa.len()).filter(|&scan| kpa[scan].is_finite());
    let top = known.max_by(|&a, &b| kpa[a].total_cmp(&kpa[b])).ok_or(RecordingError::NoPressure)?;
    let falling: Vec<bool> = rising(kpa, &legs(kpa)).into_iter().map(|rises| !rises).collect();
    let (masks, rest) = (Masks::missing(scans), rest_scans(kpa));
    let of = |taxel: usize| baseline(scans.counts[taxel], masks.of(taxel), &rest);
    let baseline: Vec<TaxelBaseline> = (0..scans.counts.len()).map(of).collect();
    Ok(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: format!("{}, rising", method(&recipe.options)),
        board_settings: Vec::new(),
        baseline,
        pressure_max_kpa: kpa[top],
        gauge_gain_rel: recipe.options.gauge.gain_rel,
        gauge_offset_kpa: recipe.options.gauge.offset_kpa,
        taxels: models(scans, kpa, &falling, recipe, workers),
        recorded: None,
        recalibrated: None,
        maker: Maker::this(false),
    })
}

/// How it fits, in words.
pub(crate) fn method(options: &FitOptions) -> String {
    format!("order {}, paper", options.order)
}

/// One model per taxel, of the scans in which the pressure is not `falling`.
pub(crate) fn models(
    scans: &Scans<'_>,
    kpa: &[f64],
    falling: &[bool],
    recipe: &FitRecipe,
    workers: &dyn Workers,
) -> Vec<TaxelModel> {
    map(workers, scans.counts.len(), |taxel| {
        let known = |scan: &usize| kpa[*scan].is_finite() && scans.counts[taxel][*scan].is_finite() && !falling[*scan];
        let rows: Vec<usize> = (0..kpa.len()).filter(known).collect();
        let (counts, kpa): (Vec<f64>, Vec<f64>) = rows.iter().map(|row| (scans.counts[taxel][*row], kpa[*row])).unzip();
        taxel_model::fit(&Samples::new(&counts, &kpa), &recipe.options)
    })
}
