//! The sections of a skin that is no skin board's: `[[patch.signals]]`, `[patch.array]` and `[patch.push]`.

use serde::Deserialize;
use std::path::PathBuf;

use super::number_words::{OrderOfBytes, UnitWord};

/// `[[patch.signals]]`: taxels in the frames of one identifier, or of several that are alike.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalsSection {
    /// Identifier of the frame.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    #[serde(default)]
    pub extended: bool,
    /// First bit of the first taxel, counted as in DBC files.
    #[serde(default)]
    pub start_bit: u16,
    /// Bits of a taxel, 4 to 24.
    pub length_bits: u16,
    /// `little` or `big` endian.
    #[serde(default)]
    pub byte_order: OrderOfBytes,
    /// Two's complement.
    #[serde(default)]
    pub signed: bool,
    /// Taxels in the frame.
    #[serde(default = "one")]
    pub count: u16,
    /// Bits from one taxel to the next; their width if absent.
    pub stride_bits: Option<u16>,
    /// What selects the frame, if it is multiplexed: all of these.
    #[serde(default)]
    pub mux: Vec<MuxSection>,
    /// How many frames there are of this kind.
    #[serde(default = "one")]
    pub frames: u16,
    /// What is added to the identifier from one of them to the next.
    #[serde(default)]
    pub id_step: u32,
    /// What is added to the value of the last `mux` from one of them to the next.
    #[serde(default)]
    pub mux_step: u32,
    /// Which device sends it, 1 to 15: taxels that have power and zero in common.
    #[serde(default = "first_device")]
    pub device: u8,
    /// In a DBC file, for messages.
    #[serde(skip)]
    pub name: String,
}

const fn one() -> u16 {
    1
}

const fn first_device() -> u8 {
    1
}

/// A selector of a multiplexed frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MuxSection {
    /// First bit of the selecting number.
    #[serde(default)]
    pub start_bit: u16,
    /// Its bits.
    pub length_bits: u16,
    /// `little` or `big` endian.
    #[serde(default)]
    pub byte_order: OrderOfBytes,
    /// The number that selects the frame.
    pub value: u64,
    /// Further numbers that do, first and last of each run.
    #[serde(default)]
    pub also: Vec<[u64; 2]>,
}

/// `[patch.array]`: what all signals of a patch have in common.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ArraySection {
    /// Least and greatest number of a taxel that is used; by default all that its bits hold.
    pub numbers: Option<[i64; 2]>,
    /// A grid of taxels: rows,
    pub rows: Option<u16>,
    /// columns, along which the taxels are numbered,
    pub columns: Option<u16>,
    /// and millimetres from one taxel to the next.
    pub pitch_mm: Option<f64>,
    /// Where a scan begins.
    pub scan: ScanWord,
    /// The frame that begins one, for `scan = "frame"`.
    pub sync: Option<FrameSection>,
    /// The number that counts scans in every frame, for `scan = "counter"`.
    pub counter: Option<NumberSection>,
    /// A number that a device tells of its state.
    pub status: Option<StatusSection>,
    /// A device's temperature.
    pub temperature: Option<TemperatureSection>,
    /// Frames that make the device stream.
    pub command: Vec<CommandSection>,
    /// A DBC file, relative to this one, that the names below are looked up in.
    pub dbc: Option<PathBuf>,
    /// Taxels: names `Message.Signal`, in which `*` stands for any letters.
    pub taxels: Vec<String>,
    /// The gauge: `Message.Signal`. What the file does not say of it is in `[patch.array.gauge_is]`.
    pub gauge: Option<String>,
    /// The scan counter, the state and the temperature of the device in the file, as the gauge is named.
    pub dbc_counter: Option<String>,
    /// See `dbc_counter`.
    pub dbc_status: Option<String>,
    /// What `dbc_status` is while all is well.
    pub status_good: i64,
    /// See `dbc_counter`.
    pub dbc_temperature: Option<String>,
    /// What a DBC file does not say of a gauge.
    pub gauge_is: GaugeIsSection,
}

impl ArraySection {
    /// The first of the keys that name something in a DBC file.
    pub fn of_dbc(&self) -> Option<&'static str> {
        let keys = [
            ("taxels", !self.taxels.is_empty()),
            ("gauge", self.gauge.is_some()),
            ("gauge_is", self.gauge_is != GaugeIsSection::default()),
            ("dbc_counter", self.dbc_counter.is_some()),
            ("dbc_status", self.dbc_status.is_some()),
            ("dbc_temperature", self.dbc_temperature.is_some()),
        ];
        keys.iter().find(|(_, given)| *given).map(|(key, _)| *key)
    }
}

/// `[patch.push]`: taxels of a patch on a bus with `source = "push"`.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushSection {
    /// How many taxels a scan has.
    pub taxels: u16,
    /// The greatest raw count of a taxel; the least is 0.
    #[serde(default = "byte")]
    pub count_max: u16,
    /// Whether the pressure in the bag comes with the scans.
    #[serde(default)]
    pub pressure: bool,
    /// Relative standard uncertainty of the gain of what measures it.
    #[serde(default)]
    pub pressure_gain_uncertainty: f64,
    /// Standard uncertainty of its zero in kPa.
    #[serde(default)]
    pub pressure_offset_uncertainty_kpa: f64,
    /// Standard deviation of one reading in kPa.
    #[serde(default)]
    pub pressure_noise_kpa: f64,
}

const fn byte() -> u16 {
    255
}

/// Where a scan begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScanWord {
    /// Frames close in time belong together.
    #[default]
    Time,
    /// With one of the frames.
    Frame,
    /// With each new number of a counter.
    Counter,
}

/// A frame, multiplexed or not.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameSection {
    /// Its identifier.
    pub id: u32,
    /// Whether that has 29 bits.
    #[serde(default)]
    pub extended: bool,
    /// What selects it.
    #[serde(default)]
    pub mux: Vec<MuxSection>,
}

/// A number in a frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberSection {
    /// First bit.
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
}

/// A state that a device tells.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatusSection {
    /// Its frame.
    pub frame: FrameSection,
    /// Its place.
    pub number: NumberSection,
    /// What it is while all is well.
    #[serde(default)]
    pub good: i64,
}

/// A temperature that a device tells.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemperatureSection {
    /// Its frame.
    pub frame: FrameSection,
    /// Its place.
    pub number: NumberSection,
    /// Degrees Celsius per step.
    #[serde(default = "unity")]
    pub scale: f64,
    /// Degrees Celsius at 0.
    #[serde(default)]
    pub offset: f64,
}

const fn unity() -> f64 {
    1.0
}

/// A frame that is sent when the device is brought up.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandSection {
    /// Its identifier.
    pub id: u32,
    /// Whether that has 29 bits.
    #[serde(default)]
    pub extended: bool,
    /// Its bytes in hexadecimal digits.
    pub data: String,
    /// How long after the beginning it is sent.
    #[serde(default)]
    pub after_ms: u32,
    /// The device that it is for.
    #[serde(default = "first_device")]
    pub device: u8,
}

/// `[patch.array.gauge_is]`: as the keys of `[patch.gauge]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaugeIsSection {
    /// Its unit, where the file has none that is known here.
    pub unit: Option<UnitWord>,
    /// In the place of the factor in the file: units a step.
    pub scale: Option<f64>,
    /// In the place of the offset in the file: units at 0.
    pub offset: Option<f64>,
    /// If it reads the absolute bag pressure: the ambient pressure in kPa.
    pub ambient_kpa: Option<f64>,
    /// Relative standard uncertainty of its gain.
    pub gain_uncertainty: f64,
    /// Standard uncertainty of its zero in kPa.
    pub offset_uncertainty_kpa: f64,
    /// Standard deviation of one reading in kPa.
    pub noise_kpa: f64,
}
