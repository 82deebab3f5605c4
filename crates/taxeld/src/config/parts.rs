//! The sections of the configuration file. Defaults are the ones of `deploy/taxeld.toml`.

use serde::Deserialize;
use std::path::PathBuf;
use toml::Spanned;

use super::area_words::{AreaFactorWord, AreaWord};
use super::fit_section::FitSection;
use super::modules::KindWord;
use super::number_words::{OrderOfBytes, UnitWord};
use super::signal_parts::{ArraySection, PushSection, SignalsSection};

/// `[store]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoreSection {
    /// The SQLite file; made if absent.
    pub path: PathBuf,
    /// Beyond so many megabytes no session is started and no model set imported.
    #[serde(default = "four_gigabytes")]
    pub budget_mb: u64,
    /// Model sets to keep; those beyond go, oldest first, and never an active one.
    pub keep_model_sets: Option<usize>,
    /// Sessions to keep; never less than the newest of each patch and what is in use.
    pub keep_sessions: Option<usize>,
    /// Samples to keep; sessions go until there are no more.
    pub keep_samples: Option<u64>,
    /// Megabytes of the store to keep; sessions go until there are no more.
    pub keep_mb: Option<u64>,
}

fn four_gigabytes() -> u64 {
    4096
}

/// `[log]`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogSection {
    /// What is logged, as `RUST_LOG` says it, which decides where it is set.
    pub filter: Option<String>,
}

/// `[[bus]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusSection {
    /// How patches and gauges name it.
    pub name: String,
    /// Where its frames come from.
    #[serde(default)]
    pub source: BusSource,
    /// The network interface, for `socketcan`; in a replay, the interface of the log.
    pub interface: Option<String>,
    /// Seed of the simulated skin, for `sim`.
    #[serde(default = "one")]
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // read by the simulator alone
    pub seed: u64,
}

fn one() -> u64 {
    1
}

/// Where frames come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BusSource {
    /// A network interface.
    #[default]
    SocketCan,
    /// The simulator: a forearm in a bag.
    Sim,
    /// None come: a program pushes the scans of the one patch that is on it.
    Push,
}

/// `[[patch]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSection {
    /// Its name in the service.
    pub name: String,
    /// The bus that its boards sit on.
    pub bus: String,
    /// Whether the daemon sends nothing to the boards.
    #[serde(default)]
    pub listen_only: bool,
    /// Period at which whole scans come, in ms: 1 to 209 for skin boards, to 5000 for other arrays.
    #[serde(default = "fifty")]
    pub period_ms: u16,
    /// A position file, relative to this one.
    pub geometry: Option<PathBuf>,
    /// How the areas of the taxels are known.
    #[serde(default = "super::area_words::template")]
    pub area: Spanned<AreaWord>,
    /// Whether they are multiplied by the factor that known loads give.
    #[serde(default)]
    pub area_factor: AreaFactorWord,
    /// Area per taxel; by default that of an iCub triangle, with the gaps beside it unless the areas are `equal`.
    pub area_mm2: Option<f64>,
    /// Relative standard uncertainty of the area; by default as little as is known of it.
    pub area_uncertainty: Option<f64>,
    /// What a force sample carries beside the total: `resultant`, `moment`, `contacts`, `fill`.
    #[serde(default)]
    pub outputs: Vec<OutputWord>,
    /// The boards, in the order of the taxels.
    #[serde(default)]
    pub board: Vec<BoardSection>,
    /// Taxels of a sensor that is no skin board of iCub, in order.
    #[serde(default)]
    pub signals: Vec<SignalsSection>,
    /// What these have in common.
    pub array: Option<ArraySection>,
    /// Taxels whose scans a program pushes.
    pub push: Option<PushSection>,
    /// The bag's pressure sensor.
    pub gauge: Option<GaugeSection>,
    /// Touch and silence.
    #[serde(default)]
    pub live: LiveSection,
    /// The zero.
    #[serde(default)]
    pub tare: TareSection,
    /// Whether the zero follows the temperature.
    #[serde(default)]
    pub drift: DriftSection,
    /// Rules of a session.
    #[serde(default)]
    pub session: SessionSection,
    /// How models are fitted.
    #[serde(default)]
    pub fit: FitSection,
}

fn fifty() -> u16 {
    50
}

/// A part of the force sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputWord {
    /// Force vector.
    Resultant,
    /// Moment and centre of pressure.
    Moment,
    /// Clusters of touched taxels.
    Contacts,
    /// Excluded taxels take the pressure of their neighbours.
    Fill,
}

/// `[[patch.board]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardSection {
    /// CAN address, 1 to 15.
    pub address: u8,
    /// Enabled modules: `"0-15"`, `"0-3, 7"`, `"0-4 fingertip, 8-11 palm"`.
    pub modules: Spanned<String>,
    /// The line of the file that `modules` is on, from 1; 0 where there is no file.
    #[serde(skip)]
    pub line: usize,
    /// What the modules are that have no kind of their own.
    #[serde(default)]
    pub kind: KindWord,
    /// Type in command 0x4D.
    #[serde(default)]
    pub board_type: u8,
    /// The count of an unloaded value.
    #[serde(default = "no_load")]
    pub no_load: u8,
    /// Right shift from converter units to counts.
    #[serde(default = "two")]
    pub shift: u8,
    /// Converter offset.
    #[serde(default = "cdc_offset")]
    pub cdc_offset: u16,
    /// Modules with other values.
    #[serde(default)]
    pub exception: Vec<ExceptionSection>,
}

fn no_load() -> u8 {
    240
}

fn two() -> u8 {
    2
}

fn cdc_offset() -> u16 {
    0x2200
}

/// `[[patch.board.exception]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExceptionSection {
    /// Which modules, as in the board.
    pub modules: String,
    /// Right shift.
    pub shift: u8,
    /// Converter offset.
    pub cdc_offset: u16,
}

/// `[patch.gauge]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaugeSection {
    /// Its bus, if it is not the patch's.
    pub bus: Option<String>,
    /// Identifier of its frames.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    #[serde(default)]
    pub extended: bool,
    /// First bit, counted as in DBC files.
    #[serde(default)]
    pub start_bit: u16,
    /// Bits.
    pub length_bits: u16,
    /// `little` or `big` endian.
    #[serde(default)]
    pub byte_order: OrderOfBytes,
    /// Two's complement.
    #[serde(default)]
    pub signed: bool,
    /// Unit per step.
    #[serde(default = "unity")]
    pub scale: f64,
    /// Unit at 0.
    #[serde(default)]
    pub offset: f64,
    /// Unit.
    pub unit: UnitWord,
    /// If the sensor reads the absolute bag pressure: the ambient pressure in kPa.
    pub ambient_kpa: Option<f64>,
    /// Relative standard uncertainty of its gain.
    #[serde(default)]
    pub gain_uncertainty: f64,
    /// Standard uncertainty of its zero in kPa.
    #[serde(default)]
    pub offset_uncertainty_kpa: f64,
    /// Standard deviation of one reading in kPa.
    #[serde(default)]
    pub noise_kpa: f64,
}

fn unity() -> f64 {
    1.0
}

/// `[patch.live]`; absent keys keep the engine's defaults.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LiveSection {
    /// Active beyond so many times the rest noise.
    pub activation_sigmas: Option<f64>,
    /// Least activation distance in counts.
    pub activation_floor_counts: Option<f64>,
    /// A module is stale after so many periods of silence.
    pub stale_periods: Option<u32>,
    /// Share of stale taxels above which there is no force.
    pub stale_share_max: Option<f64>,
}

/// `[patch.tare]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TareSection {
    /// How long the skin is watched.
    pub seconds: f64,
    /// Whether the zero is taken by itself after start, once rest is proven.
    pub at_start: bool,
    /// Of earlier versions; has no effect.
    pub first_scans: Option<u32>,
}

impl Default for TareSection {
    fn default() -> Self {
        Self { seconds: 1.0, at_start: true, first_scans: None }
    }
}

/// `[patch.drift]`; absent keys keep the engine's defaults.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriftSection {
    /// Whether the zero follows the temperature of the skin.
    pub follow: bool,
    /// How fast at most.
    pub rate_counts_per_min: Option<f64>,
    /// How far at most from the proven zero.
    pub bound_counts: Option<f64>,
}

/// `[patch.session]`; absent keys keep the engine's defaults.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SessionSection {
    /// A ramp ends by itself here.
    pub target_kpa: Option<f64>,
    /// Whether the skin lies in a chamber under pressure, whose targets may lie above what a vacuum bag reaches.
    pub pressurised_chamber: bool,
    /// Which branches of the pressure a session gathers, unless it asks for others.
    pub branches: BranchesWord,
    /// A sample may lie so far behind the furthest pressure so far.
    pub noise_band_kpa: Option<f64>,
    /// Steepest rise that enters.
    pub rise_max_kpa_per_s: Option<f64>,
    /// Steepest fall that enters; that of the rise if absent.
    pub fall_max_kpa_per_s: Option<f64>,
    /// The falling branch ends by itself here.
    pub fall_end_kpa: Option<f64>,
    /// The gauge is silent after so long.
    pub gauge_timeout_s: Option<f64>,
    /// A session without progress fails after so long.
    pub patience_s: Option<f64>,
    /// A ramp begins only below this.
    pub vented_below_kpa: Option<f64>,
}

/// Branches of the pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BranchesWord {
    /// Rising pressure alone.
    #[default]
    Rising,
    /// The fall after it too.
    Both,
}
