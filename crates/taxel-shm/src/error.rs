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
    /// What has the folder's name is somebody else's, or others may write in it.
    #[error("{path}: {problem}")]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// What was found and what was expected.
        problem: String,
    },
    /// The folder is not one to publish in.
    #[error("{path}: {problem}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// Another account can have put it there.
    #[error("{path}: {problem}")]
    Untrusted {
        /// The file, or the folder on the way to it.
        path: PathBuf,
        /// What was found and what was expected.
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
    /// Whether another time it may work, and nobody has to change a configuration for it: the machine is short of something
    /// (memory of the file system or the group's share of it, descriptors), or somebody has put something of his own in the
    /// place, as any account can in `/dev/shm`.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        use nix::libc::{EDQUOT, EMFILE, ENFILE, ENOMEM, ENOSPC};
        match self {
            Self::System { source, .. } => {
                matches!(source.raw_os_error(), Some(ENOSPC | EDQUOT | ENOMEM | EMFILE | ENFILE))
            }
            Self::Occupied { .. } => true,
            Self::Folder { .. } | Self::Untrusted { .. } | Self::NotAPage { .. } => false,
        }
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
    fn a_want_of_memory_may_pass_and_what_somebody_has_to_configure_does_not() {
        let refused = |errno| PageError::of(Path::new("/p"), "making the page")(io::Error::from_raw_os_error(errno));
        assert!(refused(ENOSPC).may_pass() && refused(EMFILE).may_pass());
        assert!(!refused(EACCES).may_pass() && !refused(ENOENT).may_pass());
        let (path, problem) = (|| "/p".into(), || "is there".to_owned());
        assert!(PageError::Occupied { path: path(), problem: problem() }.may_pass());
        assert!(!PageError::Folder { path: path(), problem: problem() }.may_pass());
    }
}
