//! Words for how a number lies in a frame and what it is in.

use serde::Deserialize;
use taxel_wire::signal::PressureUnit;

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

/// A pressure unit by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct UnitWord(pub PressureUnit);

impl TryFrom<String> for UnitWord {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let expected = || format!("unknown unit `{name}`, expected one of {}", PressureUnit::NAMES);
        PressureUnit::named(&name).map(Self).ok_or_else(expected)
    }
}
