//! The certificate as values: the JSON is these fields, the page is made of the JSON.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A certificate. Pressures in kPa, counts in units (`counts_per_unit` raw counts each), forces in newton.
#[derive(Clone, Debug, Serialize)]
pub struct Certificate {
    pub(super) format: &'static str,
    pub(super) version: u32,
    /// Empty while it is worked out.
    pub(super) number: String,
    pub(super) software: String,
    /// Whether no skin was measured: a simulator or a replayed log sent the samples.
    pub(super) simulated: bool,
    pub(super) stated: Stated,
    pub(super) set: SetPart,
    pub(super) session: SessionPart,
    pub(super) ramps: Vec<RampPart>,
    pub(super) levels: Vec<LevelPart>,
    pub(super) mean: MeanPart,
    pub(super) budget: Vec<BudgetRow>,
    pub(super) expanded: Expanded,
    pub(super) loads: Vec<LoadPart>,
    pub(super) loads_summary: Option<LoadsSummary>,
    pub(super) limits: Vec<String>,
    pub(super) excluded: Vec<ExcludedPart>,
    pub(super) taxels: Vec<TaxelPart>,
    pub(super) hashes: Hashes,
}

/// What people state of a calibration, as it stands in their file. What is `None` was not stated, and the certificate
/// says so.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stated {
    /// For whom the calibration was made.
    pub customer: Option<String>,
    /// Who made it: laboratory or company.
    pub laboratory: Option<String>,
    /// Who was at the robot.
    pub operator: Option<String>,
    /// Where.
    pub place: Option<String>,
    /// The robot, with its serial number.
    pub robot: Option<String>,
    /// Serial number of the skin.
    pub skin_serial: Option<String>,
    /// Make and type of the reference pressure sensor.
    pub reference_sensor: Option<String>,
    /// Its serial number.
    pub reference_serial: Option<String>,
    /// Number of its own calibration certificate.
    pub reference_certificate: Option<String>,
    /// When it was calibrated.
    pub reference_date: Option<String>,
    /// Its expanded uncertainty (k = 2) by that certificate, in kPa.
    pub reference_expanded_uncertainty_kpa: Option<f64>,
    /// To which national standard it is traceable.
    pub traceability: Option<String>,
    /// Air temperature during the calibration, in degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Relative humidity, in %.
    pub humidity_percent: Option<f64>,
    /// Ambient pressure, in kPa.
    pub ambient_kpa: Option<f64>,
    /// Anything else.
    pub remarks: Option<String>,
}

/// The model set.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SetPart {
    pub id: String,
    pub patch: String,
    pub made: String,
    pub method: String,
    /// Name and version of the program that fitted it, if that is known.
    pub fitted_by: Option<String>,
    pub board_settings: Vec<String>,
    pub taxels: usize,
    pub usable: usize,
    pub pressure_max_kpa: f64,
    pub gauge_gain_rel: f64,
    pub gauge_offset_kpa: f64,
}

/// The session. What only the daemon knows is absent in a certificate made of files.
#[derive(Clone, Debug, Serialize)]
pub(super) struct SessionPart {
    pub number: u64,
    pub started: Option<String>,
    pub branches: &'static str,
    pub target_kpa: Option<f64>,
    pub rest_confirmed_by: Option<String>,
    pub scans: usize,
    pub refused: BTreeMap<String, u64>,
    pub counts_per_unit: f64,
}

/// SHA-256 of what is exported, in hexadecimal digits.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Hashes {
    pub samples_csv: String,
    pub models_json: String,
}

/// One ramp.
#[derive(Clone, Debug, Serialize)]
pub(super) struct RampPart {
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
pub(super) struct LevelPart {
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
pub(super) struct MeanPart {
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
pub(super) struct BudgetRow {
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
pub(super) struct Expanded {
    pub coverage_factor: f64,
    pub taxel_kpa: f64,
    pub mean_kpa: f64,
}

/// A known load.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LoadPart {
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
    pub error_percent: f64,
    /// Error over its expanded uncertainty; beyond -1 to 1 they disagree.
    pub normalised_error: f64,
}

/// All known loads.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LoadsSummary {
    pub loads: usize,
    pub mean_absolute_error_percent: f64,
    /// How many are within their expanded uncertainty.
    pub within: usize,
}

/// A usable taxel.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TaxelPart {
    pub taxel: usize,
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
}

/// A taxel without a usable model.
#[derive(Clone, Debug, Serialize)]
pub(super) struct ExcludedPart {
    pub taxel: usize,
    pub status: &'static str,
    pub reason: String,
}
