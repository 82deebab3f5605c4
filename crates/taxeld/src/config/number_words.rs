//! Words for how a number lies in a frame and what it is in.

use serde::Deserialize;

/// Byte order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OrderOfBytes {
    /// Least significant first.
    #[default]
    Little,
    /// Most significant first.
    Big,
}

/// Pressure unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum UnitWord {
    /// Pascal.
    Pa,
    /// Kilopascal.
    #[serde(rename = "kPa")]
    Kpa,
    /// Bar.
    #[serde(rename = "bar")]
    Bar,
    /// Millibar.
    #[serde(rename = "mbar")]
    Mbar,
    /// Pound-force per square inch.
    #[serde(rename = "psi")]
    Psi,
}
