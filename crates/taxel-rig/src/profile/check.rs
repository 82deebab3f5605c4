//! What is wrong with a profile: all of it at once, each with its key.

/// The keys that are wrong, and in words what was expected.
#[derive(Debug, Default)]
pub struct Faults(pub Vec<(String, String)>);

impl Faults {
    /// Notes what is wrong with a key unless it `holds`.
    pub(super) fn require(&mut self, key: &str, holds: bool, words: impl FnOnce() -> String) {
        if !holds {
            self.0.push((key.to_owned(), format!("{key}{}", words())));
        }
    }

    /// The value, which should be in a range.
    pub(super) fn within(&mut self, key: &str, value: f64, least: f64, most: f64) -> f64 {
        self.require(key, (least..=most).contains(&value), || format!(" = {value}: expected {least} to {most}"));
        value
    }

    /// The value of a text, or nothing where it is wrong, which is noted.
    pub fn read<T>(&mut self, key: &str, text: &str, read: Result<T, String>) -> Option<T> {
        read.map_err(|why| self.require(key, false, || format!(" = {text:?}: {why}"))).ok()
    }
}
