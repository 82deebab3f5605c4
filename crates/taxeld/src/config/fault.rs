//! Why a value of the configuration cannot be used, and which key it is.

use taxel_skin::printable;

/// Why a configuration, or a part of it, cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The key within what was looked at, for example `gauge.id`; empty if no single key is wrong.
    key: String,
    /// What was expected; empty if the words say it.
    expected: String,
    /// What is wrong and what was expected, in words. Names from the file may be in them: no character changes a terminal.
    words: String,
}

impl Fault {
    /// Of this key.
    pub fn of(key: impl Into<String>, words: impl Into<String>) -> Self {
        Self { key: key.into(), ..Self::from(words.into()) }
    }

    /// Of this key, whose value is not in the range.
    pub fn range(key: &str, value: f64, min: f64, max: f64) -> Self {
        let expected = format!("{min} to {max}");
        Self { key: key.to_owned(), words: format!("{key} = {value}: expected {expected}"), expected }
    }

    /// The same where the key is within `section`, which people know as `name`.
    pub fn within(self, section: &str, name: &str) -> Self {
        let key = if self.key.is_empty() { section.to_owned() } else { format!("{section}.{}", self.key) };
        Self { key, words: format!("{}: {}", printable(name), self.words), ..self }
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

impl From<String> for Fault {
    fn from(words: String) -> Self {
        Self { key: String::new(), expected: String::new(), words: printable(&words) }
    }
}

/// The value, if it is in the range.
///
/// # Errors
/// The key, the value and the range.
pub fn within(key: &str, value: f64, min: f64, max: f64) -> Result<f64, Fault> {
    if value >= min && value <= max { Ok(value) } else { Err(Fault::range(key, value, min, max)) }
}
