//! What keeps a page from being made or opened.

use std::fmt::Display;
use std::path::Path;

use thiserror::Error;

/// A page or its folder that cannot be used: which, and why not.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct PageError(String);

impl PageError {
    /// What was found and what was expected.
    pub(crate) fn refused(path: &Path, problem: impl Display) -> Self {
        Self(format!("{}: {problem}", path.display()))
    }

    /// For `map_err`: the system's refusal of what was being done.
    pub(crate) fn of<E: Display>(path: &Path, doing: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self::refused(path, format!("{doing}: {error}"))
    }
}
