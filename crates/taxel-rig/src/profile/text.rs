//! A drive that is told lines of text.

use std::time::Duration;

use serde::Deserialize;
use taxel_wire::signal::PressureUnit;

use super::question::{Expects, Question, Refers};
use crate::Faults;
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
    set_answer: Option<String>,
    set_point: Option<String>,
    set_point_answer: Option<String>,
    vent: String,
    vent_answer: Option<String>,
    hold: Option<String>,
    hold_answer: Option<String>,
    pressure: Option<String>,
    pressure_answer: Option<String>,
}

/// Its lines.
#[derive(Debug)]
pub(super) struct Text {
    decimals: usize,
    refers: Refers,
    /// How the set point stands in the line that sets, and its unit.
    slot: (String, PressureUnit),
    set: Line,
    set_point: Option<Line>,
    vent: Line,
    hold: Option<Line>,
    pressure: Option<Line>,
}

/// A line to the drive with its end, and what is answered to it; nothing where no answer comes.
#[derive(Debug)]
struct Line {
    name: &'static str,
    sent: String,
    answer: Option<Template>,
}

/// What is in braces, but not what JSON has in them.
fn placeholders(text: &str) -> Vec<&str> {
    let inside = text.split('{').skip(1).filter_map(|rest| Some(rest.split_once('}')?.0));
    inside.filter(|inside| inside.chars().all(|c| c.is_alphanumeric() || matches!(c, '*' | '/'))).collect()
}

/// From the keys to the lines.
struct Reading<'a> {
    ending: String,
    own_limit_s: f64,
    /// Whether a command may be without an answer: the set point is asked for, and its answer shows that the drive is there.
    may_be_silent: bool,
    faults: &'a mut Faults,
}

impl Reading<'_> {
    /// One line, with the drive's own limit in it.
    fn text(&mut self, key: &str, text: &str) -> String {
        self.faults.require(key, !text.is_empty() && !text.contains(char::is_control), || {
            format!(" = {text:?}: expected one line of text, without its end")
        });
        let ms = format!("{:.0}", 1e3 * self.own_limit_s);
        text.replace("{ms}", &ms).replace("{s}", &self.own_limit_s.to_string())
    }

    /// The line of a key and its answer; `asks` if it is for a number that the answer has in it.
    fn line(&mut self, name: &'static str, keys: (Option<&String>, Option<&String>), asks: bool) -> Option<Line> {
        let (key, answers) = (format!("text.{name}"), format!("text.{name}_answer"));
        let (Some(text), answer) = keys else {
            self.faults
                .require(&key, keys.1.is_none(), || format!(": expected both {name} and {name}_answer, or neither"));
            return None;
        };
        let sent = self.text(&key, text);
        self.faults.require(&key, name == "set" || placeholders(&sent).is_empty(), || {
            format!(" = {text:?}: expected no braces: the set point belongs to set, {{*}} to an answer")
        });
        let may_be_silent = self.may_be_silent && !matches!(name, "set_point" | "pressure");
        self.faults.require(&answers, answer.is_some() || may_be_silent, || {
            " is missing: what is answered; where nothing is, give set_point and set_point_answer".to_owned()
        });
        let answer = answer.and_then(|answer| {
            let expected = self.text(&answers, answer);
            self.faults.require(&answers, expected != sent, || {
                format!(" = {answer:?}: an echo of {name} is no answer: leave it out, and give set_point")
            });
            let template = self.faults.read(&answers, &expected, Template::pattern(&expected))?;
            self.faults.require(&answers, !asks || template.unit().is_some(), || {
                let or = if name == "set" { ", or the keys set_point and set_point_answer beside it" } else { "" };
                format!(" = {answer:?}: it has no number: expected its unit in braces, as in \"P={{kPa}}\"{or}")
            });
            Some(template)
        });
        Some(Line { name, sent: sent + &self.ending, answer })
    }
}

impl Text {
    pub(super) fn new(keys: &Keys, own_limit: Option<Duration>, refers: Refers, faults: &mut Faults) -> Option<Self> {
        let ending = keys.ending.clone().unwrap_or_else(|| "\n".to_owned());
        faults.require("text.ending", ["\n", "\r", "\r\n"].contains(&ending.as_str()), || {
            format!(" = {ending:?}: expected \"\\n\", \"\\r\" or \"\\r\\n\"")
        });
        let decimals = keys.decimals.unwrap_or(2);
        faults.range("text.decimals", decimals as f64, 0.0, 6.0);
        let (own_limit_s, is_read) = (own_limit.unwrap_or_default().as_secs_f64(), keys.set_point.is_some());
        let mut reading = Reading { ending, own_limit_s, may_be_silent: is_read, faults };
        let set = reading.line("set", (Some(&keys.set), keys.set_answer.as_ref()), !is_read);
        let set_point = (keys.set_point.as_ref(), keys.set_point_answer.as_ref());
        let set_point = reading.line("set_point", set_point, true);
        let vent = reading.line("vent", (Some(&keys.vent), keys.vent_answer.as_ref()), false);
        let hold = reading.line("hold", (keys.hold.as_ref(), keys.hold_answer.as_ref()), false);
        let pressure = reading.line("pressure", (keys.pressure.as_ref(), keys.pressure_answer.as_ref()), true);
        let (set, vent) = (set?, vent?);
        let slot = match placeholders(&set.sent)[..] {
            [one] => PressureUnit::named(one).map(|unit| (format!("{{{one}}}"), unit)),
            _ => None,
        };
        faults.require("text.set", slot.is_some(), || {
            let names = PressureUnit::NAMES;
            format!(" = {:?}: expected the set point once, as its unit in braces: one of {names}", keys.set)
        });
        Some(Self { decimals, refers, slot: slot?, set, set_point, vent, hold, pressure })
    }

    pub(super) const fn holds(&self) -> bool {
        self.hold.is_some()
    }

    pub(super) fn questions(&self, order: Order) -> Vec<Question> {
        let (command, set_kpa) = match order {
            Order::Silence => return Vec::new(),
            Order::Set(kpa) => (Some(&self.set), Some(self.refers.turned(kpa))),
            Order::Hold => (self.hold.as_ref(), None),
            Order::Vent => (Some(&self.vent), None),
        };
        let (slot, unit) = &self.slot;
        let number = format!("{:.*}", self.decimals, unit.from_kilopascal(set_kpa.unwrap_or_default()));
        let is_silent = command.is_some_and(|command| command.answer.is_none());
        let read_back = self.set_point.as_ref().filter(|_| set_kpa.is_some() || is_silent);
        let (mut questions, mut sent) = (Vec::new(), String::new());
        for line in [command, read_back, self.pressure.as_ref()].into_iter().flatten() {
            sent.push_str(&line.sent.replace(slot, &number));
            // What is not answered goes out with the next question.
            let Some(template) = line.answer.clone() else { continue };
            let unit_kpa = template.unit().unwrap_or_default().to_kilopascal(1.0);
            let expects = match set_kpa {
                _ if line.name == "pressure" => Expects::Pressure { unit_kpa, refers: self.refers },
                Some(kpa) => Expects::SetPoint { sent: kpa / unit_kpa, within: self.rounding_kpa() / unit_kpa },
                None => Expects::Taken,
            };
            let speech = Speech::Text { poll: std::mem::take(&mut sent), template };
            questions.push(Question { speech, expects, key: format!("text.{}_answer", line.name) });
        }
        questions
    }

    /// A set point is read back within so much.
    fn rounding_kpa(&self) -> f64 {
        self.slot.1.to_kilopascal(0.5 * 0.1_f64.powi(self.decimals as i32)) + ROUNDING_KPA
    }
}
