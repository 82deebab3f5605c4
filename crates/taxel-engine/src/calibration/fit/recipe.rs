//! From a calibration recording to a model set.

use std::ops::Range;

use taxel_model::Workers;

use crate::baseline::TaxelBaseline;
use crate::calibration::branch::{Branch, PlaysChoice};
use crate::calibration::fit::clock;
use crate::calibration::fit::course::Course;
use crate::calibration::fit::gauge_zero;
use crate::calibration::fit::lag;
use crate::calibration::fit::legs::GAUGE_MEDIAN_SCANS;
use crate::calibration::fit::masks::Masks;
use crate::calibration::fit::recipe_options::{FitRecipe, RecordingError};
use crate::calibration::fit::scans::{Scans, modules};
use crate::calibration::fit::skin_fit::{MASKED_MAX, SkinFit};
use crate::calibration::fit::smooth::running_median;
use crate::calibration::fit::zero::{baseline, rest_scans, zero_return};
use crate::calibration::method::{method as method_of, plays_in_words};
use crate::model_set::{Maker, ModelSet, Recorded};

/// Fits a recording. The set comes without id, patch and time of making.
///
/// # Errors
/// [`RecordingError::NoPressure`]. A taxel that cannot be fitted is no error: its status says why.
pub fn fit(scans: &Scans<'_>, recipe: &FitRecipe, workers: &dyn Workers) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    let recipe = &recipe.settled();
    let (masks, faults) = masks(scans, recipe, workers);
    let kpa = if recipe.is_paper() { gauge.to_vec() } else { running_median(gauge, GAUGE_MEDIAN_SCANS) };
    let whole: Vec<Range<usize>> = std::iter::once(0..scans.len()).collect();
    let lag_s = if recipe.max_lag_s > 0.0 { lag::estimate(scans, &kpa, &masks, &whole, recipe.max_lag_s) } else { 0.0 };
    let mut kpa = lag::shifted(scans.time_s, &kpa, lag_s, &whole);
    // Without plays the loop of hysteresis would be taken for a lag.
    let looks_for_clock = recipe.max_clock_s > 0.0 && recipe.plays != PlaysChoice::Off && !recipe.is_paper();
    let max_clock_s = looks_for_clock.then_some(recipe.max_clock_s);
    let course = Course::of_recording(&kpa);
    let clock = max_clock_s.and_then(|max_s| clock::find(scans, &kpa, &masks, &course, max_s));
    if let Some(clock) = clock.filter(|clock| clock.wins) {
        kpa = clock::set_right(scans.time_s, &kpa, &clock);
    }
    let top = top_of(&kpa).ok_or(RecordingError::NoPressure)?;
    let gauge_zero_kpa = if recipe.gauge_zero { gauge_zero::find(scans, &kpa, &masks) } else { 0.0 };
    kpa.iter_mut().for_each(|p| *p -= gauge_zero_kpa);
    let course = if recipe.is_paper() { Course::of_rises(&kpa) } else { Course::of_recording(&kpa) };
    let fit = SkinFit::new(scans, masks, kpa, course, recipe);
    let fitted = fit.run(workers);
    let (usable, rest) = (fitted.usable(), rest_scans(&fit.kpa, top));
    let of = |t: usize| baseline(scans.counts[t], fit.masks.of(t), &rest);
    let baseline: Vec<TaxelBaseline> = (0..scans.counts.len()).map(of).collect();
    // The paper fits broken taxels, too. How far the others come back is not theirs to say.
    let faults = faults.as_ref().unwrap_or(&fit.masks);
    let sound: Vec<usize> = usable.into_iter().filter(|&t| faults.share(t) <= MASKED_MAX).collect();
    let zero_return = zero_return(scans, faults, &fit.kpa, &baseline, &sound);
    Ok(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: method(recipe, fitted.plays_on, gauge_zero_kpa),
        board_settings: Vec::new(),
        pressure_max_kpa: fit.kpa[top],
        gauge_gain_rel: recipe.options.gauge.gain_rel,
        gauge_offset_kpa: recipe.options.gauge.offset_kpa,
        recorded: (scans.is_recording() || !recipe.is_paper()).then(|| Recorded {
            smooth_s: recipe.smooth_s,
            plays_mean_s: 0.0,
            module_size: recipe.module_size,
            lag_s,
            zero_return,
            clock: clock.as_ref().map(clock::told),
            plays_error_ratio: fitted.plays_error_ratio,
            taxels: fitted.in_use,
        }),
        baseline,
        taxels: fitted.models,
        recalibrated: None,
        maker: Maker::this(false),
    })
}

/// What of the scans must not be believed, and the faults of the skin where that is something else: of the paper's scans
/// only what was never read is left out.
fn masks(scans: &Scans<'_>, recipe: &FitRecipe, workers: &dyn Workers) -> (Masks, Option<Masks>) {
    if recipe.is_paper() && !scans.is_recording() {
        return (Masks::missing(scans), None);
    }
    let modules = modules(scans.counts.len(), recipe.module_size);
    let faults = Masks::find(scans, &modules, &recipe.faults).without_dropouts(scans, workers);
    if recipe.is_paper() { (Masks::missing(scans), Some(faults)) } else { (faults, None) }
}

/// The scan of the highest pressure; `None` without a pressure.
fn top_of(kpa: &[f64]) -> Option<usize> {
    let known = kpa.iter().enumerate().filter(|(_, p)| p.is_finite());
    Some(known.max_by(|a, b| a.1.total_cmp(b.1))?.0)
}

/// How a set was fitted, in words.
fn method(recipe: &FitRecipe, plays_on: bool, gauge_zero_kpa: f64) -> String {
    let branch = match recipe.branch {
        Branch::Both => "rising and falling",
        Branch::Rising => "rising",
    };
    let plays = if plays_on { plays_in_words(recipe.plays_order) } else { String::new() };
    let zero = match gauge_zero_kpa {
        0.0 => String::new(),
        zero_kpa => format!(", less {zero_kpa:.2} kPa that the gauge reads at rest"),
    };
    format!("{}, {branch}{plays}{zero}", method_of(&recipe.options))
}
