//! What keeps a page from being made or opened.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// A page or its folder that cannot be used.
#[derive(Debug, Error)]
pub enum PageError {
    /// The system said no.
    #[error("{path}: {doing}: {source}")]
    System {
        /// What could not be used.
        path: PathBuf,
        /// What was being done.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// It is not what it has to be: the folder of one daemon alone, or a page that its daemon alone can have made.
    #[error("{path}: {problem}")]
    Refused {
        /// The folder or the file.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
}

impl PageError {
    /// For `map_err`: the system's refusal of what was being done.
    pub(crate) fn of(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::System { path: path.to_owned(), doing, source }
    }
}
