//! A drive that is spoken to in lines of text, as a file describes it: what is sent, what it answers, what vents the bag when
//! nobody speaks to it any more.

use std::fmt;
use std::time::Duration;

use serde::Deserialize;
use taxel_wire::signal::PressureUnit;

use crate::drive::{Abilities, Limits, Order};
use crate::template::Template;

/// A bag cannot be further below ambient, kPa; what air presses with, kPa.
const HIGHEST_KPA: f64 = 95.0;
/// Beside the last digit that is sent, a drive may round, kPa.
const ROUNDING_KPA: f64 = 0.02;

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

/// What the drive's numbers refer to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Reference {
    /// 20 is 20 below the air outside.
    #[default]
    BelowAmbient,
    /// -20 is 20 below the air outside.
    Ambient,
    /// The pressure itself: `ambient_kpa` less 20.
    Absolute,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    at: String,
    #[serde(default = "line_feed")]
    ending: String,
    #[serde(default)]
    reference: Reference,
    ambient_kpa: Option<f64>,
    #[serde(default = "two")]
    decimals: usize,
    set: String,
    set_answer: String,
    vent: String,
    vent_answer: String,
    hold: Option<String>,
    hold_answer: Option<String>,
    fail_safe: FailSafe,
    own_limit_s: Option<f64>,
    #[serde(default = "highest")]
    highest_kpa: f64,
    #[serde(default = "kpa_per_s")]
    kpa_per_s: f64,
    #[serde(default = "hold_s")]
    hold_s: f64,
    #[serde(default = "total_s")]
    total_s: f64,
}

fn line_feed() -> String {
    "\n".to_owned()
}

const fn two() -> usize {
    2
}

const fn highest() -> f64 {
    75.0
}

const fn kpa_per_s() -> f64 {
    1.0
}

const fn hold_s() -> f64 {
    20.0
}

const fn total_s() -> f64 {
    900.0
}

/// A drive's profile that makes sense.
#[derive(Debug)]
pub struct Profile {
    file: File,
    set: Set,
    set_answer: Template,
}

/// What is sent for a set point.
#[derive(Debug)]
struct Set {
    before: String,
    after: String,
    unit: PressureUnit,
}

/// What is wrong with a profile: the key, and what was expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProfileFault(String);

impl fmt::Display for ProfileFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ProfileFault {}

fn expect(holds: bool, what: impl FnOnce() -> String) -> Result<(), ProfileFault> {
    if holds { Ok(()) } else { Err(ProfileFault(what())) }
}

impl Profile {
    /// Reads a profile.
    ///
    /// # Errors
    /// The key that is wrong, and what was expected.
    pub fn new(text: &str) -> Result<Self, ProfileFault> {
        let file: File = toml::from_str(text).map_err(|error| ProfileFault(error.to_string()))?;
        let within = |key: &str, value: f64, least: f64, most: f64| {
            expect((least..=most).contains(&value), || format!("{key} = {value}: expected {least} to {most}"))
        };
        within("highest_kpa", file.highest_kpa, 6.0, HIGHEST_KPA)?;
        within("kpa_per_s", file.kpa_per_s, 0.1, 5.0)?;
        within("hold_s", file.hold_s, 1.0, 120.0)?;
        within("total_s", file.total_s, 30.0, 7200.0)?;
        within("decimals", file.decimals as f64, 0.0, 6.0)?;
        expect(["\n", "\r", "\r\n"].contains(&file.ending.as_str()), || {
            format!("ending = {:?}: expected \"\\n\", \"\\r\" or \"\\r\\n\"", file.ending)
        })?;
        match (file.fail_safe, file.own_limit_s) {
            (FailSafe::OwnLimit, Some(seconds)) => within("own_limit_s", seconds, 0.5, 30.0)?,
            (FailSafe::OwnLimit, None) => {
                return Err(ProfileFault("own_limit_s is missing: fail_safe = \"own_limit\" needs it".into()));
            }
            (_, None) => {}
            (_, Some(_)) => {
                return Err(ProfileFault("own_limit_s: expected with fail_safe = \"own_limit\" alone".into()));
            }
        }
        expect((file.reference == Reference::Absolute) == file.ambient_kpa.is_some(), || {
            "ambient_kpa: expected with reference = \"absolute\", and there alone".to_owned()
        })?;
        expect(file.hold.is_some() == file.hold_answer.is_some(), || {
            "hold and hold_answer: expected both, or neither".to_owned()
        })?;
        for (key, text) in [("set", Some(&file.set)), ("vent", Some(&file.vent)), ("hold", file.hold.as_ref())] {
            let is_line = text.is_none_or(|text| !text.is_empty() && !text.contains(char::is_control));
            expect(is_line, || format!("{key}: expected one line of text, without its end"))?;
        }
        let set = Set::new(&file.set)?;
        let set_answer =
            Template::new(&file.set_answer).map_err(|fault| ProfileFault(format!("set_answer: {fault}")))?;
        Ok(Self { file, set, set_answer })
    }

    /// What it is.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.file.name
    }

    /// Where it is: a device with its rate, or `tcp:HOST:PORT`.
    #[must_use]
    pub fn at(&self) -> &str {
        &self.file.at
    }

    /// What vents the bag without this program.
    #[must_use]
    pub const fn fail_safe(&self) -> FailSafe {
        self.file.fail_safe
    }

    /// Rate of rise and fall, kPa/s.
    #[must_use]
    pub const fn kpa_per_s(&self) -> f64 {
        self.file.kpa_per_s
    }

    /// Limits that hold whatever is asked for.
    #[must_use]
    pub fn limits(&self) -> Limits {
        let span = |seconds: f64| Duration::from_secs_f64(seconds);
        Limits { highest_kpa: self.file.highest_kpa, hold: span(self.file.hold_s), total: span(self.file.total_s) }
    }

    /// What it can do.
    #[must_use]
    pub fn abilities(&self) -> Abilities {
        Abilities { own_limit: self.file.own_limit_s.map(Duration::from_secs_f64), holds: self.file.hold.is_some() }
    }

    /// The line that is sent, with its end; `None` for silence.
    #[must_use]
    pub fn line(&self, order: Order) -> Option<String> {
        let text = match order {
            Order::Silence => return None,
            Order::Set(kpa) => {
                let (number, decimals) = (self.number(kpa), self.file.decimals);
                format!("{}{number:.decimals$}{}", self.set.before, self.set.after)
            }
            Order::Vent => self.file.vent.clone(),
            // Without a way to hold, none is asked for.
            Order::Hold => self.file.hold.clone()?,
        };
        Some(self.with_limit(&text) + &self.file.ending)
    }

    /// Whether a line is the answer to an order: of a set point, that it was taken as it was given.
    #[must_use]
    pub fn is_answer(&self, order: Order, line: &str) -> bool {
        let is_like = |pattern: &str| is_like(&self.with_limit(pattern), line);
        match order {
            Order::Silence => false,
            Order::Vent => is_like(&self.file.vent_answer),
            Order::Hold => self.file.hold_answer.as_deref().is_some_and(is_like),
            Order::Set(kpa) => {
                let digit = self.set.unit.to_kilopascal(0.5 * 0.1_f64.powi(self.file.decimals as i32));
                let taken = self.set_answer.read(line).map(|number| self.kpa(number));
                taken.is_ok_and(|taken| (taken - kpa).abs() <= digit + ROUNDING_KPA)
            }
        }
    }

    /// In the drive's unit and reference.
    fn number(&self, kpa: f64) -> f64 {
        let kpa = match self.file.reference {
            Reference::BelowAmbient => kpa,
            Reference::Ambient => -kpa,
            Reference::Absolute => self.file.ambient_kpa.unwrap_or_default() - kpa,
        };
        kpa / self.set.unit.to_kilopascal(1.0)
    }

    /// kPa below ambient of what it answers.
    fn kpa(&self, number: f64) -> f64 {
        let kpa = self.set_answer.unit().to_kilopascal(number);
        match self.file.reference {
            Reference::BelowAmbient => kpa,
            Reference::Ambient => -kpa,
            Reference::Absolute => self.file.ambient_kpa.unwrap_or_default() - kpa,
        }
    }

    fn with_limit(&self, text: &str) -> String {
        let seconds = self.file.own_limit_s.unwrap_or_default();
        text.replace("{ms}", &format!("{:.0}", 1e3 * seconds)).replace("{s}", &format!("{seconds}"))
    }
}

impl Set {
    fn new(text: &str) -> Result<Self, ProfileFault> {
        let fault = || {
            let names = PressureUnit::NAMES;
            ProfileFault(format!("set = {text:?}: expected the set point once, as its unit in braces: one of {names}"))
        };
        let mut found = None;
        for (at, _) in text.match_indices('{') {
            let Some((inside, after)) = text[at + 1..].split_once('}') else { return Err(fault()) };
            let Some(unit) = PressureUnit::named(inside) else { continue };
            let set = Self { before: text[..at].to_owned(), after: after.to_owned(), unit };
            if found.replace(set).is_some() {
                return Err(fault());
            }
        }
        found.ok_or_else(fault)
    }
}

/// Whether a line is as a pattern has it; `{*}` is any text.
fn is_like(pattern: &str, line: &str) -> bool {
    let mut parts = pattern.split("{*}");
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = line.trim().strip_prefix(first) else { return false };
    let mut ends = true;
    for part in parts {
        ends = part.is_empty();
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    ends && pattern.contains("{*}") || rest.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MICRO: &str = include_str!("../../../deploy/rigs/micro.toml");

    fn sent(profile: &Profile, order: Order) -> String {
        profile.line(order).unwrap()
    }

    #[test]
    fn a_set_point_goes_out_in_the_drives_unit_and_is_read_back() {
        let micro = Profile::new(MICRO).unwrap();
        assert_eq!(sent(&micro, Order::Set(12.345)), "set 12.35 2000\n");
        assert!(micro.is_answer(Order::Set(12.345), "ok set 12.35"));
        for other in ["ok set 12.30", "ok set", "ok vent", ""] {
            assert!(!micro.is_answer(Order::Set(12.345), other), "{other}");
        }
        assert!(micro.is_answer(Order::Vent, "ok vent") && !micro.is_answer(Order::Vent, "ok hold"));
        let alicat = Profile::new(include_str!("../../../deploy/rigs/alicat.toml")).unwrap();
        assert_eq!(sent(&alicat, Order::Set(12.0)), "AS-12.00\r");
        assert!(alicat.is_answer(Order::Set(12.0), "A -011.93 -012.00"));
        assert!(
            !alicat.is_answer(Order::Set(12.0), "A -012.00 -011.00"),
            "the pressure is there, the set point is not"
        );
        assert!(!alicat.is_answer(Order::Set(12.0), "?"));
    }

    #[test]
    fn absolute_numbers_and_other_units_are_converted() {
        let text = MICRO
            .replace("set = \"set {kPa} {ms}\"", "set = \"P{mbar}\"\nreference = \"absolute\"\nambient_kpa = 100.0");
        let profile = Profile::new(&text.replace("ok set {kPa}", "P={mbar}")).unwrap();
        assert_eq!(sent(&profile, Order::Set(20.0)), "P800.00\n");
        assert!(profile.is_answer(Order::Set(20.0), "P=800.00") && !profile.is_answer(Order::Set(20.0), "P=200.00"));
    }

    #[test]
    fn what_is_wrong_with_a_profile_is_said() {
        for (from, to, says) in [
            ("set = \"set {kPa} {ms}\"", "set = \"set\"", "expected the set point once"),
            ("set = \"set {kPa} {ms}\"", "set = \"{kPa} {Pa}\"", "expected the set point once"),
            ("set_answer = \"ok set {kPa}\"", "set_answer = \"ok\"", "set_answer: it has no number"),
            ("own_limit_s = 2.0", "", "own_limit_s is missing"),
            ("own_limit_s = 2.0", "own_limit_s = 0.1", "own_limit_s = 0.1: expected 0.5 to 30"),
            ("fail_safe = \"own_limit\"", "fail_safe = \"attended\"", "own_limit_s: expected with"),
            ("fail_safe = \"own_limit\"", "fail_safe = \"hope\"", "hope"),
            ("highest_kpa = 75.0", "highest_kpa = 120.0", "highest_kpa = 120: expected 6 to 95"),
            ("vent = \"vent\"", "vent = \"\"", "vent: expected one line"),
            ("name = ", "colour = \"red\"\nname = ", "colour"),
            ("hold = \"hold {ms}\"", "", "hold and hold_answer"),
        ] {
            assert!(MICRO.contains(from), "{from}");
            let error = Profile::new(&MICRO.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(says), "{to}: {error}");
        }
    }
}
