//! What is wrong with a profile or a configuration: all of it at once, each with its key.

use std::fmt::Display;

/// Collects faults by key and in words: a check that finds one notes it and goes on.
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

    /// Notes what is wrong with a key unless it `holds`; the words go on behind the key.
    pub fn require<W: Display>(&mut self, key: &str, holds: bool, words: impl FnOnce() -> W) {
        if !holds {
            self.note(key, format!("{key}{}", words()));
        }
    }

    /// The value as it is; noted if it is not in the range.
    pub fn range(&mut self, key: &str, value: f64, least: f64, most: f64) -> f64 {
        self.require(key, (least..=most).contains(&value), || format!(" = {value}: expected {least} to {most}"));
        value
    }

    /// The value, or nothing where it is wrong, which is noted.
    pub fn take<T>(&mut self, key: &str, value: Result<T, impl Display>) -> Option<T> {
        value.map_err(|words| self.note(key, words)).ok()
    }

    /// The value of a text, or nothing where it is wrong, which is noted.
    pub fn read<T>(&mut self, key: &str, text: &str, read: Result<T, String>) -> Option<T> {
        self.take(key, read.map_err(|why| format!("{key} = {text:?}: {why}")))
    }

    /// Whether nothing is wrong so far.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// All of them: key and words.
    #[must_use]
    pub fn found(self) -> Vec<(String, String)> {
        self.found
    }
}
