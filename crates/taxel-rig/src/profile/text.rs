//! A drive that is told lines of text, and answers each with one.

use std::time::Duration;

use serde::Deserialize;
use taxel_wire::signal::PressureUnit;

use super::check::{expect, within};
use super::question::{Expects, Question, Refers};
use crate::drive::Order;
use crate::talk::Speech;
use crate::template::Template;

/// Beside the last digit that is sent, a drive may round, kPa.
const ROUNDING_KPA: f64 = 0.02;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Keys {
    ending: Option<String>,
    decimals: Option<usize>,
    set: String,
    set_answer: String,
    vent: String,
    vent_answer: String,
    hold: Option<String>,
    hold_answer: Option<String>,
    pressure: Option<String>,
    pressure_answer: Option<String>,
}

/// Its lines.
#[derive(Debug)]
pub(super) struct Text {
    ending: String,
    decimals: usize,
    refers: Refers,
    set: Set,
    set_answer: Template,
    vent: Speech,
    hold: Option<Speech>,
    pressure: Option<Speech>,
}

/// What is sent for a set point.
#[derive(Debug)]
struct Set {
    before: String,
    after: String,
    unit: PressureUnit,
}

impl Text {
    pub(super) fn new(keys: Keys, own_limit: Option<Duration>, refers: Refers) -> Result<Self, String> {
        let ending = keys.ending.unwrap_or_else(|| "\n".to_owned());
        expect(["\n", "\r", "\r\n"].contains(&ending.as_str()), || {
            format!("ending = {ending:?}: expected \"\\n\", \"\\r\" or \"\\r\\n\"")
        })?;
        let decimals = keys.decimals.unwrap_or(2);
        within("decimals", decimals as f64, 0.0, 6.0)?;
        let seconds = own_limit.unwrap_or_default().as_secs_f64();
        let line = |key: &str, text: &str| -> Result<String, String> {
            expect(!text.is_empty() && !text.contains(char::is_control), || {
                format!("{key}: expected one line of text, without its end")
            })?;
            Ok(text.replace("{ms}", &format!("{:.0}", 1e3 * seconds)).replace("{s}", &format!("{seconds}")))
        };
        let speech = |key: &str, text: &str, answer: &str| -> Result<Speech, String> {
            let template = Template::pattern(&line(key, answer)?);
            let template = template.map_err(|fault| format!("{key}_answer: {fault}"))?;
            Ok(Speech::Text { poll: line(key, text)? + &ending, template })
        };
        let both = |key: &str, text: Option<String>, answer: Option<String>| match (text, answer) {
            (Some(text), Some(answer)) => speech(key, &text, &answer).map(Some),
            (None, None) => Ok(None),
            _ => Err(format!("{key} and {key}_answer: expected both, or neither")),
        };
        let set = Set::new(&line("set", &keys.set)?)?;
        let set_answer = Template::new(&line("set_answer", &keys.set_answer)?);
        let set_answer = set_answer.map_err(|fault| format!("set_answer: {fault}"))?;
        let vent = speech("vent", &keys.vent, &keys.vent_answer)?;
        let hold = both("hold", keys.hold, keys.hold_answer)?;
        let pressure = both("pressure", keys.pressure, keys.pressure_answer)?;
        Ok(Self { ending, decimals, refers, set, set_answer, vent, hold, pressure })
    }

    pub(super) const fn holds(&self) -> bool {
        self.hold.is_some()
    }

    pub(super) fn questions(&self, order: Order) -> Vec<Question> {
        let taken = |speech: &Speech| Question { speech: speech.clone(), expects: Expects::Taken };
        let command = match order {
            Order::Silence => return Vec::new(),
            Order::Set(kpa) => Some(self.set(kpa)),
            Order::Hold => self.hold.as_ref().map(taken),
            Order::Vent => Some(taken(&self.vent)),
        };
        let pressure = self.pressure.as_ref().map(|speech| {
            let unit = if let Speech::Text { template, .. } = speech { template.unit() } else { None };
            let expects =
                Expects::Pressure { unit_kpa: unit.unwrap_or_default().to_kilopascal(1.0), refers: self.refers };
            Question { speech: speech.clone(), expects }
        });
        command.into_iter().chain(pressure).collect()
    }

    /// A set point, and its read-back.
    fn set(&self, kpa: f64) -> Question {
        let (kpa, decimals) = (self.refers.turned(kpa), self.decimals);
        let (sent_in, answered_in) = (self.set.unit, self.set_answer.unit().unwrap_or_default());
        let number = kpa / sent_in.to_kilopascal(1.0);
        let poll = format!("{}{number:.decimals$}{}{}", self.set.before, self.set.after, self.ending);
        let within_kpa = sent_in.to_kilopascal(0.5 * 0.1_f64.powi(decimals as i32)) + ROUNDING_KPA;
        let unit_kpa = answered_in.to_kilopascal(1.0);
        let expects = Expects::SetPoint { sent: kpa / unit_kpa, within: within_kpa / unit_kpa };
        Question { speech: Speech::Text { poll, template: self.set_answer.clone() }, expects }
    }
}

impl Set {
    fn new(text: &str) -> Result<Self, String> {
        let found = text.split_once('{').and_then(|(before, rest)| Some((before, rest.split_once('}')?)));
        let unit = found.and_then(|(_, (inside, _))| PressureUnit::named(inside));
        match (found, unit) {
            (Some((before, (_, after))), Some(unit)) if !after.contains('{') => {
                Ok(Self { before: before.to_owned(), after: after.to_owned(), unit })
            }
            _ => {
                let names = PressureUnit::NAMES;
                Err(format!("set = {text:?}: expected the set point once, as its unit in braces: one of {names}"))
            }
        }
    }
}
