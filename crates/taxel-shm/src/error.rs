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
    /// The folder is not one to publish in.
    #[error("{path}: {problem}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// The file is no page, or one of another version.
    #[error("{path}: {problem}")]
    NotAPage {
        /// The file.
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
