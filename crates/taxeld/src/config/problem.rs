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
