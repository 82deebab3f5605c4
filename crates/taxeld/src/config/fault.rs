//! What is wrong with the values of a configuration, each with its key.

use std::fmt::Display;

use taxel_skin::printable;

/// What a user should know of a configuration with which nothing is wrong.
#[derive(Clone, Debug, Default)]
pub struct Said {
    /// What is left out and why, a line each.
    pub left_out: Vec<String>,
    /// What else, a line each.
    pub remarks: Vec<String>,
}

/// A value that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Its key in the file, for example `patch[0].gauge.id`; empty if no single key is wrong.
    key: String,
    /// What was expected; empty if the words say it.
    expected: String,
    /// What is wrong and what was expected. Names from the file may be in them: no character changes a terminal.
    words: String,
}

impl Fault {
    /// Of this key.
    pub fn of(key: impl Into<String>, words: impl Display) -> Self {
        Self { key: key.into(), expected: String::new(), words: printable(&words.to_string()) }
    }

    /// The key; empty if no single key is wrong.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// What was expected; empty if the words say it.
    pub fn expected(&self) -> &str {
        &self.expected
    }

    /// What is wrong and what was expected.
    pub fn words(&self) -> &str {
        &self.words
    }
}

/// Collects all faults of a configuration: whoever finds one notes it and goes on.
#[derive(Debug, Default)]
pub struct Faults {
    found: Vec<Fault>,
    /// What comes before every key that is noted, `patch[0].` for example.
    section: String,
    /// What people know the section as, `patch `left_forearm`: ` for example.
    name: String,
}

impl Faults {
    /// What is noted in `look` is of this section, which people know as `name`.
    pub fn within<T>(&mut self, section: &str, name: &str, look: impl FnOnce(&mut Self) -> T) -> T {
        let inner = (format!("{}{section}.", self.section), format!("{}{}: ", self.name, printable(name)));
        let outer = (std::mem::replace(&mut self.section, inner.0), std::mem::replace(&mut self.name, inner.1));
        let value = look(self);
        (self.section, self.name) = outer;
        value
    }

    /// Notes what is wrong with a key of the section; with an empty key, with the section itself.
    pub fn note(&mut self, key: &str, words: impl Display) {
        let key = format!("{}{key}", self.section);
        self.found.push(Fault::of(key.trim_end_matches('.'), format!("{}{words}", self.name)));
    }

    /// The value, or nothing where it is wrong, which is noted.
    pub fn take<T>(&mut self, key: &str, value: Result<T, impl Display>) -> Option<T> {
        value.map_err(|words| self.note(key, words)).ok()
    }

    /// The value as it is; noted if it is not in the range.
    pub fn range(&mut self, key: &str, value: f64, min: f64, max: f64) -> f64 {
        if !(min..=max).contains(&value) {
            let expected = format!("{min} to {max}");
            self.note(key, format!("{key} = {value}: expected {expected}"));
            self.found.iter_mut().last().into_iter().for_each(|fault| fault.expected.clone_from(&expected));
        }
        value
    }

    /// Whether nothing is wrong so far.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// All of them.
    pub fn all(self) -> Vec<Fault> {
        self.found
    }
}
