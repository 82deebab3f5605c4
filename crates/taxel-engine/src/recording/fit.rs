//! From a calibration recording to a model set.

use std::ops::Range;

use taxel_model::FitOptions;
use thiserror::Error;

use crate::faults::FaultLimits;
use crate::model_set::{ModelSet, Recorded};
use crate::recording::course::Course;
use crate::recording::skin_fit::SkinFit;
use crate::recording::zero::{baseline, rest_scans, zero_return};
use crate::recording::{Masks, Scans, lag, modules, running_median};
use crate::rest::TaxelBaseline;
use crate::session::method as method_of;

/// Gauges give single readings that are off by 8 to 14 kPa: a median over 0.3 s takes them out.
const GAUGE_MEDIAN_SCANS: usize = 15;

/// Which branches of the pressure are fitted, and gathered by a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Branch {
    /// Rising pressure, as in the paper.
    #[default]
    Rising,
    /// Falling pressure too: the curve runs through the middle of the hysteresis.
    Both,
}

/// Whether hysteresis is compensated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlaysChoice {
    /// If it wins on what no fit saw: the last falling branch, or of a single one the lower half.
    #[default]
    Auto,
    /// Wherever a taxel carries it.
    On,
    /// Nowhere.
    Off,
}

/// How a recording is fitted.
#[derive(Clone, Debug)]
pub struct FitRecipe {
    /// How each taxel's static curve is fitted.
    pub options: FitOptions,
    /// Which part is fitted.
    pub branch: Branch,
    /// Whether hysteresis is compensated.
    pub plays: PlaysChoice,
    /// So many neighbouring taxels form a module.
    pub module_size: usize,
    /// Counts are averaged over so many seconds for the plays and in use; 0 is not at all.
    pub smooth_s: f64,
    /// A lag of at most so many seconds between gauge and counts is looked for; 0 is none.
    pub max_lag_s: f64,
    /// Limits of the faults.
    pub faults: FaultLimits,
}

impl Default for FitRecipe {
    fn default() -> Self {
        Self {
            options: FitOptions::default(),
            branch: Branch::Both,
            plays: PlaysChoice::default(),
            module_size: 10,
            smooth_s: 0.5,
            max_lag_s: 0.0,
            faults: FaultLimits::default(),
        }
    }
}

/// Why a recording cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RecordingError {
    /// A fit needs both.
    #[error("the recording has no pressure: expected a column `pressure_kpa` with finite numbers")]
    NoPressure,
    /// The models are of another skin.
    #[error("the recording has {recorded} taxels, the model set {models}")]
    Taxels {
        /// Taxels of the recording.
        recorded: usize,
        /// Taxels of the set.
        models: usize,
    },
}

/// Fits a recording. The set comes without id, patch and time of making. `progress` is told taxels done and all.
///
/// # Errors
/// [`RecordingError::NoPressure`]. A taxel that cannot be fitted is no error: its status says why.
pub fn fit(
    scans: &Scans<'_>,
    recipe: &FitRecipe,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<ModelSet, RecordingError> {
    let gauge = scans.pressure_kpa.ok_or(RecordingError::NoPressure)?;
    let modules = modules(scans.counts.len(), recipe.module_size);
    let masks = Masks::find(scans, &modules, &recipe.faults).without_dropouts(scans);
    let kpa = running_median(gauge, GAUGE_MEDIAN_SCANS);
    let whole: Vec<Range<usize>> = std::iter::once(0..scans.len()).collect();
    let lag_s = if recipe.max_lag_s > 0.0 { lag::estimate(scans, &kpa, &masks, &whole, recipe.max_lag_s) } else { 0.0 };
    let kpa = lag::shifted(scans.time_s, &kpa, lag_s, &whole);
    let known = kpa.iter().enumerate().filter(|(_, p)| p.is_finite());
    let top = known.max_by(|a, b| a.1.total_cmp(b.1)).ok_or(RecordingError::NoPressure)?.0;
    let fit = SkinFit { scans, masks, kpa, course: Course::of_recording(scans.len(), top), recipe };
    let fitted = fit.run(progress);
    let (usable, rest) = (fitted.usable(), rest_scans(&fit.kpa, top));
    let of = |t: usize| baseline(scans.counts[t], fit.masks.of(t), &rest);
    let baseline: Vec<TaxelBaseline> = (0..scans.counts.len()).map(of).collect();
    Ok(ModelSet {
        id: String::new(),
        patch: String::new(),
        created_wall_ns: 0,
        session: None,
        method: method(recipe, fitted.plays_on),
        board_settings: Vec::new(),
        pressure_max_kpa: fit.kpa[top],
        gauge_gain_rel: recipe.options.gauge.gain_rel,
        gauge_offset_kpa: recipe.options.gauge.offset_kpa,
        recorded: Some(Recorded {
            smooth_s: recipe.smooth_s,
            module_size: recipe.module_size,
            lag_s,
            zero_return_counts: zero_return(scans, &fit.masks, &fit.kpa, &baseline, &usable),
            plays_error_ratio: fitted.plays_error_ratio,
            taxels: fitted.in_use,
        }),
        baseline,
        taxels: fitted.models,
    })
}

/// How a set was fitted, in words.
fn method(recipe: &FitRecipe, plays_on: bool) -> String {
    let branch = match recipe.branch {
        Branch::Both => "rising and falling",
        Branch::Rising => "rising",
    };
    let plays = if plays_on { ", two plays about order 3 in use" } else { "" };
    format!("{}, {branch}{plays}", method_of(&recipe.options))
}
