//! What was found on a bus.

use std::collections::BTreeMap;

use serde::Serialize;

/// All that was found in a stretch of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Findings {
    /// From the first frame to the last, seconds.
    pub seconds: f64,
    /// Data and remote frames.
    pub frames: u64,
    /// Mean share of a 1 Mbit/s bus that they take, without stuffed bits, 0 to 1.
    pub load: f64,
    /// What the controller reported in error frames, if it did.
    pub errors: Option<ErrorsFound>,
    /// What else the bus told: that it went down, that frames were lost.
    pub notices: Vec<String>,
    /// The skin boards of which a module's whole scan came, by address, with those of their modules.
    pub boards: BTreeMap<u8, BoardFound>,
    /// Frames like a skin board's without any whole scan: the modules by address, none for frames of the board itself.
    pub never_whole: BTreeMap<u8, Vec<u8>>,
    /// All other identifiers.
    pub others: Vec<OtherFound>,
}

/// Errors on the bus.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ErrorsFound {
    /// How often what was reported.
    pub kinds: BTreeMap<&'static str, u64>,
    /// Greatest error counters of sending and of receiving, where they were told.
    pub counters_max: Option<(u8, u8)>,
}

/// A skin board.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BoardFound {
    /// Median time between two scans of a module, milliseconds.
    pub period_ms: Option<f64>,
    /// Celsius, if it sends its temperature.
    pub celsius: Option<f64>,
    /// Firmware, if it was asked for while somebody listened.
    pub firmware: Option<String>,
    /// Times that it threw its send queue away.
    pub overflows: u64,
    /// Its modules, by number.
    pub modules: BTreeMap<u8, ModuleFound>,
}

/// A module.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ModuleFound {
    /// Whole scans.
    pub scans: u64,
    /// Halves without a partner.
    pub orphans: u64,
    /// It was not heard in the last so many seconds, where that is longer than a few periods.
    pub silent_s: Option<f64>,
    /// What it can be, by what its values did: a kind is left out when one of its thermal pads was pressed.
    pub kinds: Vec<&'static str>,
    /// Whether it was pressed, so that the kinds mean something.
    pub pressed: bool,
    /// Mean of each of the twelve values.
    pub mean: Vec<f64>,
    /// What each value scatters by from scan to scan, counts.
    pub noise: Vec<f64>,
    /// Least and most of each value.
    pub range: Vec<(u8, u8)>,
    /// Values that are stuck at an end of the range or never changed while others did; the thermal pads of what can be a
    /// triangle may well do so.
    pub stuck: Vec<u8>,
    /// Values that jump.
    pub flickering: Vec<u8>,
    /// Values that the board called out of range, and how often.
    pub out_of_range: BTreeMap<u8, u64>,
    /// Scans in which the board missed an acknowledgement.
    pub no_acks: u64,
    /// Scans in which it said that nothing is connected.
    pub not_connected: u64,
}

/// An identifier that is not a skin board's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherFound {
    /// As candump writes it.
    pub id: String,
    /// Whether it has 29 bits.
    pub extended: bool,
    /// Its frames.
    pub frames: u64,
    /// Frames a second.
    pub per_s: f64,
    /// Its lengths in bytes.
    pub lengths: Vec<u8>,
    /// How its bytes could be a pressure, the likeliest first.
    pub pressures: Vec<PressureFound>,
}

/// Bits that could be a pressure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PressureFound {
    /// First bit, counted as in DBC files.
    pub start_bit: u16,
    /// How many.
    pub length_bits: u16,
    /// `little` or `big`.
    pub byte_order: &'static str,
    /// Two's complement.
    pub signed: bool,
    /// Unit that fits.
    pub unit: &'static str,
    /// Least and most, kPa.
    pub kpa: (f64, f64),
    /// What it would be: `differential` or `absolute`.
    pub meaning: &'static str,
    /// Whether it moved as a pressure does, smoothly and further than its noise; else it stood at a plausible value.
    pub moving: bool,
}
