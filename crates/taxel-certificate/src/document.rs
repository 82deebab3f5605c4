//! The certificate as values: the JSON is these fields, the page is made of them.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::entered::Entered;

/// A certificate. Pressures in kPa, counts in units (`counts_per_unit` raw counts each), forces in newton.
#[derive(Clone, Debug, Serialize)]
pub struct Certificate {
    pub(crate) format: &'static str,
    pub(crate) version: u32,
    /// Empty while it is worked out.
    pub(crate) number: String,
    pub(crate) software: String,
    /// Whether no skin was measured: a simulator or a replayed log sent the samples.
    pub(crate) simulated: bool,
    pub(crate) set: SetPart,
    pub(crate) stated: Entered,
    pub(crate) session: SessionPart,
    pub(crate) hashes: Hashes,
    pub(crate) ramps: Vec<RampPart>,
    pub(crate) levels: Vec<LevelPart>,
    pub(crate) mean: MeanPart,
    pub(crate) budget: Vec<BudgetRow>,
    pub(crate) expanded: Expanded,
    pub(crate) loads: Vec<LoadPart>,
    pub(crate) loads_summary: Option<LoadsSummary>,
    pub(crate) taxels: Vec<TaxelPart>,
    pub(crate) excluded: Vec<ExcludedPart>,
    pub(crate) limits: Vec<String>,
}

/// The model set.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SetPart {
    pub id: String,
    pub patch: String,
    pub made: String,
    pub method: String,
    /// Name and version of the programme that fitted it, if that is known.
    pub fitted_by: Option<String>,
    pub board_settings: Vec<String>,
    pub taxels: usize,
    pub usable: usize,
    pub pressure_max_kpa: f64,
    pub gauge_gain_rel: f64,
    pub gauge_offset_kpa: f64,
    /// Counts are averaged over so many seconds where hysteresis is compensated.
    pub smooth_s: f64,
}

/// The session.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SessionPart {
    pub number: u64,
    pub started: String,
    pub branches: &'static str,
    pub target_kpa: f64,
    pub rest_confirmed_by: Option<String>,
    pub left_out: Vec<String>,
    pub scans: usize,
    pub refused: BTreeMap<&'static str, u64>,
    pub counts_per_unit: f64,
}

/// SHA-256 of what is exported, in hexadecimal digits.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Hashes {
    pub samples_csv: String,
    pub models_json: String,
}

/// One ramp.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct RampPart {
    pub ramp: usize,
    pub scans_rising: usize,
    pub scans_falling: usize,
    pub from_kpa: Option<f64>,
    pub top_kpa: Option<f64>,
    pub to_kpa: Option<f64>,
    pub rise_kpa_per_s: Option<f64>,
    pub fall_kpa_per_s: Option<f64>,
    /// Zero at its beginning less that of the first ramp, over the usable taxels.
    pub zero_mean_counts: Option<f64>,
    pub zero_rms_counts: Option<f64>,
    /// What the gauge read before it, which is taken off its pressures.
    pub gauge_zero_kpa: Option<f64>,
}

/// One level of pressure on one branch, over all usable taxels and ramps.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LevelPart {
    pub branch: &'static str,
    pub from_kpa: f64,
    pub to_kpa: f64,
    pub scans: usize,
    pub reference_kpa: f64,
    pub reading_kpa: f64,
    pub error_kpa: f64,
    /// Standard deviation over the taxels of their mean errors.
    pub spread_kpa: Option<f64>,
}

/// The mean reading of all usable taxels.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeanPart {
    pub rmse_kpa: f64,
    pub bias_kpa: f64,
    pub max_error_kpa: f64,
    pub hysteresis_kpa: Option<f64>,
    pub repeatability_kpa: Option<f64>,
    /// Greatest shift of the zero between ramps, as a pressure.
    pub zero_shift_kpa: Option<f64>,
}

/// A line of the uncertainty budget: standard uncertainties in kPa; `None` where it was not determined.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BudgetRow {
    pub name: &'static str,
    pub source: &'static str,
    pub evaluation: &'static str,
    /// Of one taxel: root mean square over the usable ones.
    pub taxel_kpa: Option<f64>,
    /// Of the mean of all usable taxels under uniform pressure.
    pub mean_kpa: Option<f64>,
    /// Whether it enters the sum; what is in another line already does not.
    pub combined: bool,
}

/// Expanded uncertainties, k = 2, in kPa.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Expanded {
    pub coverage_factor: f64,
    pub taxel_kpa: f64,
    pub mean_kpa: f64,
}

/// A known load.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LoadPart {
    pub load: u64,
    pub time: String,
    pub by: String,
    pub note: String,
    pub mass_kg: Option<f64>,
    pub force_n: f64,
    pub force_sigma_n: f64,
    pub read_n: f64,
    pub read_sigma_n: f64,
    pub read_scatter_n: f64,
    pub scans: u32,
    pub out_of_range: u32,
    /// Why the force read was not good.
    pub reasons: Vec<String>,
    /// Share of it that came from taxels which were filled by their neighbours, and whether such were.
    pub filled_share: f64,
    pub filled: Option<bool>,
    pub mean_area_mm2: f64,
    pub area_factor: f64,
    pub area_uncertainty: f64,
    pub error_percent: f64,
    /// Error over its expanded uncertainty; beyond -1 to 1 they disagree.
    pub normalised_error: f64,
    /// Why it says nothing of the skin as it was under the newest load, in words; empty if it does.
    pub outdated_because: String,
    /// Why it has no say in the factor although it is of that state, in words; empty if it has.
    pub left_out_because: String,
}

/// The known loads of the state that the skin was in under the newest.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LoadsSummary {
    pub loads: usize,
    pub mean_absolute_error_percent: f64,
    pub within: usize,
    /// How many have a say in the factor.
    pub in_factor: usize,
    /// What areas are to be multiplied by, and its standard uncertainty; of three such loads or more.
    pub area_factor: Option<f64>,
    pub area_factor_sigma: Option<f64>,
    /// Relative standard uncertainty of the areas by it at a place where no load was laid.
    pub area_uncertainty: Option<f64>,
    /// Why it is no property of the skin, in words; empty if it is one, or if there is none.
    pub area_factor_doubt: String,
}

/// A usable taxel.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct TaxelPart {
    pub taxel: usize,
    pub place: String,
    pub order: usize,
    pub count_min: f64,
    pub count_max: f64,
    pub centre: f64,
    pub half_width: f64,
    pub chebyshev_kpa: Vec<f64>,
    /// Least and greatest pressure that the curve gives at the ends of its range.
    pub range_kpa: [f64; 2],
    pub sensitivity_counts_per_kpa: f64,
    pub linearity_percent: f64,
    pub rmse_kpa: f64,
    pub bias_kpa: f64,
    pub max_error_kpa: f64,
    pub hysteresis_kpa: Option<f64>,
    pub hysteresis_percent: Option<f64>,
    pub repeatability_kpa: Option<f64>,
    pub zero_counts: Option<f64>,
    pub zero_noise_counts: Option<f64>,
    pub zero_shift_counts: Option<f64>,
    pub lower_limit_kpa: f64,
    /// Share of the session's scans whose count was outside the calibrated range.
    pub outside_share: f64,
    pub expanded_uncertainty_kpa: f64,
    pub plays: Option<PlaysPart>,
}

/// How the hysteresis of a taxel is compensated in use.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PlaysPart {
    pub count_min: f64,
    pub count_max: f64,
    pub centre: f64,
    pub half_width: f64,
    pub chebyshev_kpa: Vec<f64>,
    pub radii_counts: Vec<f64>,
    pub weights_kpa: Vec<f64>,
    /// 1 where counts rise with pressure, -1 where they fall.
    pub sign: f64,
    /// Root mean square of the error with the compensation.
    pub rmse_kpa: f64,
}

/// A taxel without a usable model.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ExcludedPart {
    pub taxel: usize,
    pub place: String,
    pub status: &'static str,
    pub reason: String,
}
