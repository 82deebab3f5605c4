//! A drive as a file describes it: where it is, what it is told and answers, what vents the bag when nobody speaks to it any more,
//! and its limits.

mod check;
mod question;
mod registers;
mod text;

use std::time::Duration;

use serde::Deserialize;

use crate::drive::{Abilities, Limits, Order};
use crate::modbus::Framing;

use check::{expect, within};
pub use question::Question;
use question::{Reference, Refers};

/// A bag cannot be further below ambient, kPa; what air presses with, kPa.
const HIGHEST_KPA: f64 = 95.0;

/// What vents the bag without this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailSafe {
    /// The drive vents when it has been told nothing for `own_limit_s`. The self-test tries it.
    OwnLimit,
    /// The valve opens without power. Nobody can try that but a person who pulls the plug.
    ValveOpensWithoutPower,
    /// Somebody stands beside it, and is asked at each start.
    Attended,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    at: String,
    #[serde(default)]
    reference: Reference,
    ambient_kpa: Option<f64>,
    fail_safe: FailSafe,
    own_limit_s: Option<f64>,
    highest_kpa: Option<f64>,
    kpa_per_s: Option<f64>,
    hold_s: Option<f64>,
    total_s: Option<f64>,
    text: Option<text::Keys>,
    modbus: Option<registers::Keys>,
}

/// A drive's profile that makes sense.
#[derive(Debug)]
pub struct Profile {
    name: String,
    at: String,
    fail_safe: FailSafe,
    limits: Limits,
    kpa_per_s: f64,
    own_limit: Option<Duration>,
    protocol: Protocol,
}

#[derive(Debug)]
enum Protocol {
    Text(text::Text),
    Modbus(registers::Registers),
}

impl Profile {
    /// Reads a profile; `at` goes before what it says itself.
    ///
    /// # Errors
    /// The key that is wrong, and what was expected.
    pub fn new(text: &str, at: Option<&str>) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| error.to_string())?;
        let seconds = |key: &str, value: Option<f64>, default: f64, (least, most): (f64, f64)| {
            within(key, value.unwrap_or(default), least, most).map(Duration::from_secs_f64)
        };
        let limits = Limits {
            highest_kpa: within("highest_kpa", file.highest_kpa.unwrap_or(75.0), 6.0, HIGHEST_KPA)?,
            hold: seconds("hold_s", file.hold_s, 20.0, (1.0, 120.0))?,
            total: seconds("total_s", file.total_s, 900.0, (30.0, 7200.0))?,
        };
        let has_limit = file.fail_safe == FailSafe::OwnLimit;
        expect(has_limit == file.own_limit_s.is_some(), || {
            "own_limit_s: expected with fail_safe = \"own_limit\", and there alone".to_owned()
        })?;
        let own_limit =
            file.own_limit_s.map(|_| seconds("own_limit_s", file.own_limit_s, 0.0, (0.5, 30.0))).transpose()?;
        expect((file.reference == Reference::Absolute) == file.ambient_kpa.is_some(), || {
            "ambient_kpa: expected with reference = \"absolute\", and there alone".to_owned()
        })?;
        let refers = Refers { reference: file.reference, ambient_kpa: file.ambient_kpa.unwrap_or_default() };
        let at = at.map_or(file.at, str::to_owned);
        let protocol = match (file.text, file.modbus) {
            (Some(keys), None) => Protocol::Text(text::Text::new(keys, own_limit, refers)?),
            (None, Some(keys)) => {
                let framing = if at.starts_with("tcp:") { Framing::Tcp } else { Framing::Rtu };
                Protocol::Modbus(registers::Registers::new(keys, own_limit, (refers, framing))?)
            }
            _ => return Err("expected one of [text] and [modbus]".to_owned()),
        };
        let kpa_per_s = within("kpa_per_s", file.kpa_per_s.unwrap_or(1.0), 0.1, 5.0)?;
        Ok(Self { name: file.name, at, fail_safe: file.fail_safe, limits, kpa_per_s, own_limit, protocol })
    }

    /// What it is.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where it is: a device with its rate, or `tcp:HOST:PORT`.
    #[must_use]
    pub fn at(&self) -> &str {
        &self.at
    }

    /// What vents the bag without this program.
    #[must_use]
    pub const fn fail_safe(&self) -> FailSafe {
        self.fail_safe
    }

    /// Rate of rise and fall, kPa/s.
    #[must_use]
    pub const fn kpa_per_s(&self) -> f64 {
        self.kpa_per_s
    }

    /// Limits that hold whatever is asked for.
    #[must_use]
    pub const fn limits(&self) -> Limits {
        self.limits
    }

    /// What it can do.
    #[must_use]
    pub const fn abilities(&self) -> Abilities {
        let holds = match &self.protocol {
            Protocol::Text(text) => text.holds(),
            Protocol::Modbus(registers) => registers.holds(),
        };
        Abilities { own_limit: self.own_limit, holds }
    }

    /// What is said to it for an order, one after the other: the command, its read-back, and its own gauge. Nothing for silence.
    #[must_use]
    pub fn questions(&self, order: Order) -> Vec<Question> {
        match &self.protocol {
            Protocol::Text(text) => text.questions(order),
            Protocol::Modbus(registers) => registers.questions(order),
        }
    }
}

#[cfg(test)]
mod tests;
