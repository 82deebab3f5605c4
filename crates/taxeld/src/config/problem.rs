//! What is wrong with a configuration, for people and for programmes.

use std::fmt;

use serde::Serialize;
use taxel_skin::printable;

/// What kind of problem it is; the word is stable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Code {
    /// The file cannot be read.
    Unreadable,
    /// It is no TOML.
    Syntax,
    /// A key that does not exist.
    UnknownKey,
    /// A key that lacks, or a value that the key cannot have.
    Value,
    /// It is well written and cannot work on this machine.
    CannotWork,
}

/// One problem.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// What kind it is.
    pub code: Code,
    /// The file.
    pub file: String,
    /// Its line, from 1; 0 if it is about no line.
    pub line: usize,
    /// The key, for example `patch[0].period_ms`; empty if it is about none.
    pub key: String,
    /// What stands there; `None` if nothing does.
    pub value: Option<String>,
    /// What was expected.
    pub expected: String,
    /// The whole of it in words.
    pub message: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.file, self.message),
            line => write!(f, "{}:{line}: {}", self.file, self.message),
        }
    }
}

/// Everything that is wrong with a configuration, in the order of its lines; never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// These, in the order of their lines. What of the file is in their texts is written out where it is no printable
    /// character: a problem is one line, and changes no terminal.
    pub fn new(mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|problem| problem.line);
        for Problem { file, key, value, expected, message, .. } in &mut problems {
            [file, key, expected, message].into_iter().chain(value).for_each(|text| *text = printable(text));
        }
        Self(problems)
    }

    /// All of them.
    pub fn all(&self) -> &[Problem] {
        &self.0
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, problem) in self.0.iter().enumerate() {
            let end = if position == 0 { "" } else { "\n" };
            write!(f, "{end}{problem}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Problems {}
