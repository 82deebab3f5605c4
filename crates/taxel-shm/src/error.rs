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
    /// Whether the machine is short of something at present: memory of the file system or the group's share of it,
    /// descriptors. Another time it may work, and nobody has to change a configuration for it.
    #[must_use]
    pub fn is_shortage(&self) -> bool {
        use nix::libc::{EDQUOT, EMFILE, ENFILE, ENOMEM, ENOSPC};
        let Self::System { source, .. } = self else { return false };
        matches!(source.raw_os_error(), Some(ENOSPC | EDQUOT | ENOMEM | EMFILE | ENFILE))
    }

    /// For `map_err`: the system's refusal of what was being done.
    pub(crate) fn of(path: &Path, doing: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::System { path: path.to_owned(), doing, source }
    }
}

#[cfg(test)]
mod tests {
    use nix::libc::{EACCES, EMFILE, ENOENT, ENOSPC};

    use super::*;

    #[test]
    fn a_want_of_memory_is_a_shortage_and_what_somebody_has_to_change_is_none() {
        let refused = |errno| PageError::of(Path::new("/p"), "making the page")(io::Error::from_raw_os_error(errno));
        assert!(refused(ENOSPC).is_shortage() && refused(EMFILE).is_shortage());
        assert!(!refused(EACCES).is_shortage() && !refused(ENOENT).is_shortage());
        assert!(!PageError::Folder { path: "/p".into(), problem: "is there and is not a folder".into() }.is_shortage());
    }
}
