//! What is wrong with a configuration, each with its key.

use std::fmt::{self, Display};
use std::path::Path;

use taxel_skin::printable;

/// After so many problems no more are looked for.
pub const PROBLEMS_MAX: usize = 100;

/// What a user should know of a configuration with which nothing is wrong.
#[derive(Clone, Debug, Default)]
pub struct Said {
    /// What is left out and why, a line each.
    pub left_out: Vec<String>,
    /// What else, a line each.
    pub remarks: Vec<String>,
}

/// One problem. What of the file is in its texts is written out where it is no printable character: a problem is one line, and
/// changes no terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Problem {
    /// The line of the file, from 1; 0 if it is about no line.
    pub line: usize,
    /// The key, for example `patch[0].gauge.id`; empty if it is about none.
    pub key: String,
    /// What is wrong and what was expected.
    pub message: String,
}

impl Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, ": {}", self.message),
            line => write!(f, ":{line}: {}", self.message),
        }
    }
}

/// Everything that is wrong with a file, in the order of its lines; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems(String, Vec<Problem>);

impl Problems {
    /// These of a file, in the order of their lines.
    pub fn new(file: &Path, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.line);
        Self(printable(&file.display().to_string()), problems)
    }

    /// All of them.
    #[cfg(test)]
    pub fn all(&self) -> &[Problem] {
        &self.1
    }
}

impl Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(file, problems) = self;
        f.write_str(&problems.iter().map(|problem| format!("{file}{problem}")).collect::<Vec<_>>().join("\n"))
    }
}

impl std::error::Error for Problems {}

/// Collects all faults of a configuration, by key and in words: whoever finds one notes it and goes on.
#[derive(Debug, Default)]
pub struct Faults {
    found: Vec<(String, String)>,
    /// What comes before every key that is noted, `patch[0].` for example.
    section: String,
    /// What people know the section as, `patch `left_forearm`: ` for example.
    name: String,
}

impl Faults {
    /// What is noted in `look` is of this section, which people know as `name`.
    pub fn within<T>(&mut self, section: &str, name: &str, look: impl FnOnce(&mut Self) -> T) -> T {
        (self.section, self.name) = (format!("{section}."), format!("{name}: "));
        let value = look(self);
        (self.section, self.name) = Default::default();
        value
    }

    /// Notes what is wrong with a key of the section; with an empty key, with the section itself.
    pub fn note(&mut self, key: &str, words: impl Display) {
        let key = format!("{}{key}", self.section);
        self.found.push((key.trim_end_matches('.').to_owned(), format!("{}{words}", self.name)));
    }

    /// The value, or nothing where it is wrong, which is noted.
    pub fn take<T>(&mut self, key: &str, value: Result<T, impl Display>) -> Option<T> {
        value.map_err(|words| self.note(key, words)).ok()
    }

    /// The value as it is; noted if it is not in the range.
    pub fn range(&mut self, key: &str, value: f64, min: f64, max: f64) -> f64 {
        if !(min..=max).contains(&value) {
            self.note(key, format!("{key} = {value}: expected {min} to {max}"));
        }
        value
    }

    /// Whether nothing is wrong so far.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// All of them, as problems without a place.
    pub fn problems(self) -> impl Iterator<Item = Problem> {
        let problem = |(key, words): (String, String)| (printable(&key), printable(&words));
        self.found.into_iter().map(problem).map(|(key, message)| Problem { key, message, ..Problem::default() })
    }
}
