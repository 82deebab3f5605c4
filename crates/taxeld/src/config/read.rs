//! From the text of a file to its sections, or to everything that is wrong with it.
//!
//! serde tells one fault at a time. A key that is unknown, or has a value of another type, is noted, taken out of the tree and
//! the rest is read again: so all unknown keys are told, and what is left is checked as well.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde_path_to_error::{Segment, deserialize};
use taxel_rig::Faults;
use taxel_rig::profile::{Profile, SHIPPED};
use taxel_skin::printable;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer};

use super::file::Config;
use super::gauge;
use super::ports;
use super::problem::{PROBLEMS_MAX, Problem, Problems};
use super::scene::{Scene, scene_of};
use crate::rig::At;

/// Reads and resolves a configuration.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine(path: &Path) -> Result<(Config, Scene), Problems> {
    examine_text(path, &read_text(path).map_err(|why| unread(path, why))?)
}

fn read_text(path: &Path) -> Result<String, String> {
    match taxel_files::is_standard(path) {
        true => taxel_files::read_text(path).map_err(|error| error.root_cause().to_string()),
        false => taxel_files::read_utf8(path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => format!("{error}; `taxeld setup` writes one"),
            _ => error.to_string(),
        }),
    }
}

fn unread(path: &Path, message: String) -> Problems {
    Problems::new(path, vec![Problem { message, ..Problem::default() }])
}

/// The same of a text; `path` is for messages and for files beside it.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_text(path: &Path, text: &str) -> Result<(Config, Scene), Problems> {
    let mut reading = Reading::new(path, text);
    let mut config: Option<Config> = reading.sections();
    config.iter_mut().for_each(|config| {
        ports::expand(config);
        gauge::expand(config);
    });
    let scene = config.as_ref().and_then(|config| {
        let mut faults = Faults::default();
        let scene = scene_of(config, path, &mut faults);
        // What was taken out as wrong is not missing as well.
        let told: Vec<String> = reading.problems.iter().map(|problem| problem.key.clone()).collect();
        let new = faults.found().into_iter().filter(|(key, _)| !told.contains(&printable(key)));
        new.for_each(|(key, words)| reading.note(&key, words));
        scene
    });
    reading.end(config.zip(scene))
}

/// Reads the profile of a drive, a file or one that comes with the program, and where the drive is; `at` goes before what the
/// profile says of that.
///
/// # Errors
/// Everything that is wrong with it.
pub fn examine_profile(file: &str, at: Option<&str>) -> Result<(Profile, At), Problems> {
    let path = Path::new(file);
    let text = match SHIPPED.iter().find(|(name, _)| *name == file) {
        Some((_, text)) => (*text).to_owned(),
        None => read_text(path).map_err(|why| {
            let names = SHIPPED.map(|(name, _)| name).join(", ");
            unread(path, format!("{why}; expected a file, or one of {names}"))
        })?,
    };
    let (mut reading, mut faults) = (Reading::new(path, &text), Faults::default());
    let found = reading.sections().and_then(|file| {
        let profile = Profile::new(file, at, &mut faults)?;
        let place = faults.read("at", profile.at(), At::new(profile.at()))?;
        Some((profile, place))
    });
    faults.found().into_iter().for_each(|(key, words)| reading.note(&key, words));
    reading.end(found)
}

struct Reading<'a> {
    path: &'a Path,
    text: &'a str,
    /// As the file has it: lines and values are looked up here.
    tree: Spanned<DeTable<'a>>,
    problems: Vec<Problem>,
}

impl<'a> Reading<'a> {
    /// The tree of a text, and what is wrong with its syntax.
    fn new(path: &'a Path, text: &'a str) -> Self {
        let (tree, errors) = DeTable::parse_recoverable(text);
        let mut reading = Self { path, text, tree, problems: Vec::new() };
        for error in &errors {
            let line = error.span().map_or(1, |span| reading.line_of(span.start));
            reading.push(Problem { line, message: on_a_line(error.message()), ..Problem::default() });
        }
        reading
    }

    /// The value, if nothing is wrong.
    fn end<T>(self, value: Option<T>) -> Result<T, Problems> {
        value.filter(|_| self.problems.is_empty()).ok_or_else(|| Problems::new(self.path, self.problems))
    }

    /// The sections, if there is enough in the file to make them.
    fn sections<T: DeserializeOwned>(&mut self) -> Option<T> {
        if !self.problems.is_empty() {
            return None;
        }
        let mut left = self.tree.clone();
        let mut is_cut = false;
        while self.problems.len() < PROBLEMS_MAX {
            let error = match deserialize::<_, T>(Deserializer::from(left.clone())) {
                Ok(sections) => return Some(sections),
                Err(error) => error,
            };
            let (key, message) = (key_of(error.path()), error.inner().message());
            if message.starts_with("missing field") {
                // What was taken out lacks by our own doing.
                if !is_cut {
                    let key = with_name(&key, message);
                    self.note(&key, format!("{key} is missing"));
                }
                return None;
            }
            if message.starts_with("unknown field") {
                self.note(&with_name(&key, message), nearest_key(message));
            } else {
                self.note(&key, format!("{key}: {}", on_a_line(message)));
                is_cut = true;
            }
            if !take_out(left.get_mut(), error.inner().span().map_or(0, |span| span.start)) {
                return None;
            }
        }
        None
    }

    /// Notes what is wrong with a key, and where that is in the file.
    fn note(&mut self, key: &str, message: String) {
        let line = find(self.tree.get_ref(), key).map_or(0, |at| self.line_of(at));
        self.push(Problem { line, key: printable(key), message: printable(&message) });
    }

    fn push(&mut self, problem: Problem) {
        if self.problems.len() < PROBLEMS_MAX {
            self.problems.push(problem);
        }
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

/// Where a key, or the nearest section above it, begins in the text. `patch[0].gauge.id` is such a key.
fn find(root: &DeTable<'_>, key: &str) -> Option<usize> {
    let (mut begin, mut table) = (None, Some(root));
    for part in key.split('.').filter(|part| !part.is_empty()) {
        let (name, elements) = part.split_once('[').unwrap_or((part, ""));
        let Some((key, mut value)) = table.and_then(|table| table.get_key_value(name)) else { return begin };
        begin = Some(key.span().start);
        for number in elements.split(['[', ']']).filter_map(|number| number.parse::<usize>().ok()) {
            let element = value.get_ref().as_array().and_then(|list| list.get(number));
            let Some(element) = element else { return begin };
            (begin, value) = (Some(element.span().start), element);
        }
        table = value.get_ref().as_table();
    }
    begin
}

/// What is said of a key that does not exist, by "unknown field `x`, expected one of `a`, `b`".
fn nearest_key(message: &str) -> String {
    let words: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let Some((unknown, known)) = words.split_first() else { return message.to_owned() };
    let closeness = known.iter().map(|word| (strsim::jaro_winkler(unknown, word), *word));
    let nearest = closeness.max_by(|(a, _), (b, _)| a.total_cmp(b)).map_or("", |(_, word)| word);
    format!("unknown key `{unknown}`; did you mean `{nearest}`? Known here: {}", known.join(", "))
}

/// The words of the parser on one line.
fn on_a_line(words: &str) -> String {
    words.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(300).collect()
}

#[cfg(test)]
mod tests;
