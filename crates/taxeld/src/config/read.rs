//! From the text of a file to its sections, or to everything that is wrong with it.
//!
//! serde tells one fault at a time. A key that is unknown, or has a value of another type, is noted, taken out of the tree and
//! the rest is read again: so all unknown keys are told, and what is left is checked as well.

use std::path::Path;

use serde_path_to_error::{Segment, deserialize};
use taxel_skin::printable;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use super::fault::{Fault, Faults};
use super::file::Config;
use super::problem::{Code, Problem, Problems};
use super::scene::{Scene, scene_of};
use crate::files;

/// After so many problems no more are looked for.
const PROBLEMS_MAX: usize = 100;

/// Most patches, and most buses: every pair of patches is compared.
const PATCHES_MAX: usize = 100;

/// Longest configuration, in bytes: a whole robot has a hundredth of it.
const TEXT_BYTES_MAX: usize = 1 << 20;

/// So much of what stands in the file is repeated, in characters.
const SHOWN_CHARS_MAX: usize = 60;

/// Reads and resolves a configuration.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine(path: &Path) -> Result<(Config, Scene), Problems> {
    examine_text(path, &read_text(path)?)
}

/// Reads the text of a configuration, for whoever needs it later as it was then.
///
/// # Errors
/// If it cannot be read.
pub fn read_text(path: &Path) -> Result<String, Problems> {
    let text = match files::is_standard(path) {
        true => files::read_text(path).map_err(|error| error.root_cause().to_string()),
        false => files::read_utf8(path).map_err(|error| error.to_string()),
    };
    text.map_err(|message| Problems::new(vec![Problem { message, ..nothing(Code::Unreadable, path) }]))
}

/// The same of a text; `path` is for messages and for files beside it.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_text(path: &Path, text: &str) -> Result<(Config, Scene), Problems> {
    examine_with(path, text, |_, _| Vec::new())
}

/// The same, where `more` tells what else keeps such a configuration from being used.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_with(
    path: &Path,
    text: &str,
    more: impl FnOnce(&Config, &Scene) -> Vec<Fault>,
) -> Result<(Config, Scene), Problems> {
    let mut reading = Reading::of(path, text)?;
    let Some(config) = reading.config() else { return Err(Problems::new(reading.problems)) };
    let mut faults = Faults::default();
    let scene = scene_of(&config, path, &mut faults);
    faults.all().iter().for_each(|fault| reading.note_fault(Code::Value, fault));
    if let Some(scene) = &scene {
        more(&config, scene).iter().for_each(|fault| reading.note_fault(Code::CannotWork, fault));
    }
    match scene {
        Some(scene) if reading.problems.is_empty() => Ok((config, scene)),
        _ => Err(Problems::new(reading.problems)),
    }
}

/// Reads the text of a configuration file without resolving it; `path` is for messages.
///
/// # Errors
/// Everything that is wrong with keys and types.
#[cfg_attr(not(any(test, feature = "sim")), allow(dead_code))]
pub fn parse(path: &Path, text: &str) -> Result<Config, Problems> {
    let mut reading = Reading::of(path, text)?;
    match reading.config() {
        Some(config) if reading.problems.is_empty() => Ok(config),
        _ => Err(Problems::new(reading.problems)),
    }
}

/// Resolves a configuration; `path` is where it came from, for files relative to it and for messages.
///
/// # Errors
/// Everything that is wrong with its values.
#[cfg_attr(not(any(test, feature = "sim")), allow(dead_code))]
pub fn resolve(config: &Config, path: &Path) -> Result<Scene, Problems> {
    let mut faults = Faults::default();
    let scene = scene_of(config, path, &mut faults);
    let problem = |fault: &Fault| Problem {
        key: fault.key().to_owned(),
        expected: fault.expected().to_owned(),
        message: fault.words().to_owned(),
        ..nothing(Code::Value, path)
    };
    scene.ok_or_else(|| Problems::new(faults.all().iter().map(problem).collect()))
}

fn nothing(code: Code, path: &Path) -> Problem {
    let file = path.display().to_string();
    Problem { code, file, line: 0, key: String::new(), value: None, expected: String::new(), message: String::new() }
}

struct Reading<'a> {
    path: &'a Path,
    text: &'a str,
    /// As the file has it: lines and values are looked up here.
    tree: Spanned<DeTable<'a>>,
    problems: Vec<Problem>,
}

impl<'a> Reading<'a> {
    /// Of a text that is TOML.
    fn of(path: &'a Path, text: &'a str) -> Result<Self, Problems> {
        if text.len() > TEXT_BYTES_MAX {
            let message = format!("it has {} bytes, expected at most {TEXT_BYTES_MAX}", text.len());
            return Err(Problems::new(vec![Problem { message, ..nothing(Code::Unreadable, path) }]));
        }
        let (tree, errors) = DeTable::parse_recoverable(text);
        let mut reading = Self { path, text, tree, problems: Vec::new() };
        for error in errors.iter().take(PROBLEMS_MAX) {
            let line = error.span().map_or(1, |span| reading.line_of(span.start));
            let message = on_a_line(error.message());
            reading.problems.push(Problem { line, message, ..nothing(Code::Syntax, path) });
        }
        for section in ["patch", "bus"] {
            let list = reading.tree.get_ref().get(section).and_then(|value| value.get_ref().as_array());
            if let Some(count) = list.map(|list| list.len()).filter(|count| *count > PATCHES_MAX) {
                let words = format!("{count} sections [[{section}]]: expected at most {PATCHES_MAX}");
                reading.note_fault(Code::Value, &Fault::of(section, words));
            }
        }
        if reading.problems.is_empty() { Ok(reading) } else { Err(Problems::new(reading.problems)) }
    }

    /// The sections, if there is enough in the file to make them.
    fn config(&mut self) -> Option<Config> {
        let mut left = self.tree.clone();
        while self.problems.len() < PROBLEMS_MAX {
            let error = match deserialize::<_, Config>(Deserializer::from(left.clone())) {
                Ok(config) => return Some(config),
                Err(error) => error,
            };
            let key = key_of(error.path());
            let error = error.into_inner();
            let at = error.span().map_or(0, |span| span.start);
            if error.message().starts_with("missing field") {
                // What was taken out lacks by our own doing.
                if !self.problems.iter().any(|problem| problem.code == Code::Value) {
                    self.note_missing(&key, error.message());
                }
                return None;
            }
            self.note_shape(key, at, error.message());
            if !take_out(left.get_mut(), at) {
                return None;
            }
        }
        None
    }

    fn note_missing(&mut self, key: &str, message: &str) {
        let key = with_name(key, message);
        let words = format!("{key} is missing");
        self.note_fault(Code::Value, &Fault::of(key, words));
    }

    /// Notes an unknown key, or a value of another type, which begins at this place.
    fn note_shape(&mut self, key: String, at: usize, message: &str) {
        let line = self.line_of(at);
        let problem = if message.starts_with("unknown field") {
            let key = with_name(&key, message);
            let (expected, message) = nearest_key(message);
            Problem { key, line, expected, message, ..nothing(Code::UnknownKey, self.path) }
        } else {
            let value = find(self.tree.get_ref(), &key).1.map(in_words);
            let message = format!("{key}: {}", on_a_line(message));
            let expected = message.split_once("expected ").map_or_else(String::new, |(_, what)| what.to_owned());
            Problem { key, line, value, expected, message, ..nothing(Code::Value, self.path) }
        };
        self.problems.push(problem);
    }

    fn note_fault(&mut self, code: Code, fault: &Fault) {
        if self.problems.len() >= PROBLEMS_MAX {
            return;
        }
        let (at, value) = find(self.tree.get_ref(), fault.key());
        self.problems.push(Problem {
            line: at.map_or(0, |at| self.line_of(at)),
            key: fault.key().to_owned(),
            value: value.map(in_words),
            expected: fault.expected().to_owned(),
            message: fault.words().to_owned(),
            ..nothing(code, self.path)
        });
    }

    fn line_of(&self, at: usize) -> usize {
        1 + self.text.as_bytes()[..at.min(self.text.len())].iter().filter(|&&byte| byte == b'\n').count()
    }
}

fn key_of(path: &serde_path_to_error::Path) -> String {
    path.iter().fold(String::new(), |key, segment| match segment {
        Segment::Map { key: name } if key.is_empty() => name.clone(),
        Segment::Map { key: name } => format!("{key}.{name}"),
        Segment::Seq { index } => format!("{key}[{index}]"),
        _ => key,
    })
}

/// The key with the name that serde's message begins with, if it does not end in it.
fn with_name(key: &str, message: &str) -> String {
    let name = message.split('`').nth(1).unwrap_or_default();
    match key {
        "" => name.to_owned(),
        key if key.rsplit('.').next() == Some(name) => key.to_owned(),
        key => format!("{key}.{name}"),
    }
}

/// Takes the innermost key out of which this place is: the key itself or its value. False if there is none.
fn take_out(table: &mut DeTable<'_>, at: usize) -> bool {
    let holds = |span: std::ops::Range<usize>| span.contains(&at);
    let below = table.iter_mut().any(|(_, value)| match value.get_mut() {
        DeValue::Table(table) => take_out(table, at),
        DeValue::Array(list) => list.iter_mut().any(|item| match item.get_mut() {
            DeValue::Table(table) => take_out(table, at),
            _ => false,
        }),
        _ => false,
    });
    let own = table.iter().find(|(key, value)| holds(key.span()) || holds(value.span())).map(|(key, _)| key.clone());
    below || own.is_some_and(|key| table.remove(&key).is_some())
}

/// Where a key, or the nearest section above it, begins in the text, and what it holds. `patch[0].gauge.id` is such a key.
fn find<'t, 'i>(root: &'t DeTable<'i>, key: &str) -> (Option<usize>, Option<&'t DeValue<'i>>) {
    let (mut begin, mut table, mut found) = (None, Some(root), None);
    for part in key.split('.').filter(|part| !part.is_empty()) {
        let (name, elements) = part.split_once('[').unwrap_or((part, ""));
        let Some((key, value)) = table.and_then(|table| table.get_key_value(name)) else { return (begin, None) };
        (begin, found) = (Some(key.span().start), Some(value.get_ref()));
        for number in elements.split(['[', ']']).filter_map(|number| number.parse::<usize>().ok()) {
            let element = found.and_then(DeValue::as_array).and_then(|list| list.get(number));
            let Some(element) = element else { return (begin, None) };
            (begin, found) = (Some(element.span().start), Some(element.get_ref()));
        }
        table = found.and_then(DeValue::as_table);
    }
    (begin, found)
}

/// The nearest known key and the whole in words, of "unknown field `x`, expected one of `a`, `b`".
fn nearest_key(message: &str) -> (String, String) {
    let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let Some((unknown, known)) = words.split_first() else { return (String::new(), message.to_owned()) };
    let closeness = known.iter().map(|word| (strsim::jaro_winkler(unknown, word), *word));
    let nearest = closeness.max_by(|(a, _), (b, _)| a.total_cmp(b)).map_or("", |(_, word)| word);
    let (unknown, known) = (shortened(unknown), known.join(", "));
    (nearest.to_owned(), format!("unknown key `{unknown}`; did you mean `{nearest}`? Known here: {known}"))
}

/// A value in words.
fn in_words(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{}\"", shortened(text)),
        DeValue::Integer(number) => format!("the number {}", shortened(number.as_str())),
        DeValue::Float(number) => format!("the number {}", shortened(number.as_str())),
        DeValue::Boolean(word) => word.to_string(),
        DeValue::Datetime(moment) => format!("the time {moment}"),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

fn shortened(text: &str) -> String {
    let more = if text.chars().count() > SHOWN_CHARS_MAX { "..." } else { "" };
    printable(&text.chars().take(SHOWN_CHARS_MAX).collect::<String>()) + more
}

/// The words of the parser on one line.
fn on_a_line(words: &str) -> String {
    words.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(300).collect()
}

#[cfg(test)]
mod tests;
