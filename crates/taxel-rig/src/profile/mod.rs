//! A drive as a file describes it: where it is, what it is told and answers, what vents the bag when nobody speaks to it any more,
//! and its limits.

mod question;
mod registers;
mod text;

use std::time::Duration;

use serde::Deserialize;

use crate::Faults;
use crate::drive::{Abilities, Limits, Order};
use crate::modbus::Framing;

pub use question::Question;
use question::{Reference, Refers};

/// A bag cannot be further below ambient, kPa; what air presses with, kPa.
const HIGHEST_KPA: f64 = 95.0;

/// Profiles that come with the program, by name.
pub const SHIPPED: [(&str, &str); 5] = [
    ("micro", include_str!("../../../../deploy/rigs/micro.toml")),
    ("alicat", include_str!("../../../../deploy/rigs/alicat.toml")),
    ("epick", include_str!("../../../../deploy/rigs/epick.toml")),
    ("vg10", include_str!("../../../../deploy/rigs/vg10.toml")),
    ("analogue", include_str!("../../../../deploy/rigs/analogue.toml")),
];

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

/// The keys of a profile, as its file has them.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct File {
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
    Text(Box<text::Text>),
    Modbus(Box<registers::Registers>),
}

impl Profile {
    /// What a file says, if all of it makes sense; `at` goes before what it says itself. What is wrong is noted in `faults`.
    pub fn new(file: File, at: Option<&str>, faults: &mut Faults) -> Option<Self> {
        let mut seconds = |key: &str, value: Option<f64>, default: f64, (least, most): (f64, f64)| {
            Duration::try_from_secs_f64(faults.range(key, value.unwrap_or(default), least, most)).unwrap_or_default()
        };
        let hold = seconds("hold_s", file.hold_s, 20.0, (1.0, 120.0));
        let total = seconds("total_s", file.total_s, 900.0, (30.0, 7200.0));
        let own_limit = file.own_limit_s.map(|_| seconds("own_limit_s", file.own_limit_s, 0.0, (0.5, 30.0)));
        let highest_kpa = faults.range("highest_kpa", file.highest_kpa.unwrap_or(75.0), 6.0, HIGHEST_KPA);
        let limits = Limits { highest_kpa, hold, total };
        let kpa_per_s = faults.range("kpa_per_s", file.kpa_per_s.unwrap_or(1.0), 0.1, 5.0);
        faults.require("own_limit_s", (file.fail_safe == FailSafe::OwnLimit) == own_limit.is_some(), || {
            ": expected with fail_safe = \"own_limit\", and there alone".to_owned()
        });
        faults.require("ambient_kpa", (file.reference == Reference::Absolute) == file.ambient_kpa.is_some(), || {
            ": expected with reference = \"absolute\", and there alone".to_owned()
        });
        let refers = Refers { reference: file.reference, ambient_kpa: file.ambient_kpa.unwrap_or_default() };
        let at = at.map_or(file.at, str::to_owned);
        let protocol = match (file.text, file.modbus) {
            (Some(keys), None) => {
                text::Text::new(&keys, own_limit, refers, faults).map(|text| Protocol::Text(Box::new(text)))
            }
            (None, Some(keys)) => {
                let framing = if at.starts_with("tcp:") { Framing::Tcp } else { Framing::Rtu };
                let registers = registers::Registers::new(keys, own_limit, (refers, framing), faults);
                Some(Protocol::Modbus(Box::new(registers)))
            }
            _ => {
                faults.require("", false, || "expected one of [text] and [modbus]".to_owned());
                None
            }
        };
        let (name, fail_safe) = (file.name, file.fail_safe);
        let profile = Self { name, at, fail_safe, limits, kpa_per_s, own_limit, protocol: protocol? };
        faults.is_empty().then_some(profile)
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
    pub fn abilities(&self) -> Abilities {
        let holds = match &self.protocol {
            Protocol::Text(text) => text.holds(),
            Protocol::Modbus(registers) => registers.holds(),
        };
        Abilities { own_limit: self.own_limit, holds }
    }

    /// What it says, a line each: limits, and what goes over its line.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let (kpa, rate, total) = (self.limits.highest_kpa, self.kpa_per_s, self.limits.total.as_secs_f64());
        let fail_safe = match (self.fail_safe, self.own_limit) {
            (FailSafe::Attended, _) => "somebody stands beside its valve".to_owned(),
            (FailSafe::ValveOpensWithoutPower, _) => {
                "its valve opens without power; pull its plug to try that".to_owned()
            }
            (_, limit) => {
                format!("it vents when it is told nothing for {:.1} s", limit.unwrap_or_default().as_secs_f64())
            }
        };
        let orders = [("12.5 kPa", Order::Set(12.5)), ("hold", Order::Hold), ("vent", Order::Vent)];
        let can = |order: &Order| *order != Order::Hold || self.abilities().holds;
        let asked = orders.iter().filter(|(_, order)| can(order)).flat_map(|(what, order)| {
            let words = |question: Question| question.words();
            self.questions(*order)
                .into_iter()
                .map(words)
                .map(move |[sent, expected]| format!("{what}: sends {sent}, expects {expected}"))
        });
        let limits = format!("at most {kpa:.0} kPa below ambient, {rate:.1} kPa/s, {total:.0} s");
        [limits, format!("fail-safe: {fail_safe}")].into_iter().chain(asked).collect()
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
