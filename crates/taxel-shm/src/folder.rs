//! The folder in which one daemon publishes its pages.

use std::fs::{DirBuilder, File, TryLockError};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nix::sys::statfs::{TMPFS_MAGIC, statfs};
use nix::unistd::geteuid;

use crate::error::PageError;
use crate::force::Limits;
use crate::writer::{Lock, PageWriter};

/// Locked for as long as a daemon publishes in the folder.
const LOCK: &str = ".lock";

/// Write permission of the group and of all others.
pub(crate) const OTHERS_WRITE: u32 = 0o022;

/// A folder that this process alone publishes in.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    group: Option<u32>,
    lock: Arc<Lock>,
}

impl Folder {
    /// Takes the folder, made if it is not there. Owner and mode are checked here and never again. The pages are for the group with
    /// this number to read, else for that of the process.
    ///
    /// # Errors
    /// [`PageError`]: it is not on a tmpfs, not this account's alone to write in, or another daemon publishes there.
    pub fn open(path: &Path, group: Option<u32>) -> Result<Self, PageError> {
        if std::fs::symlink_metadata(path).is_err() {
            make(path, group)?;
        }
        private_in_memory(path)?;
        let at = path.join(LOCK);
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false).mode(0o600).custom_flags(nix::libc::O_NOFOLLOW);
        let file = options.open(&at).map_err(PageError::of(&at, "opening the lock"))?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => PageError::refused(path, "another daemon publishes its pages there"),
            TryLockError::Error(error) => PageError::of(&at, "locking")(error),
        })?;
        Ok(Self { path: path.to_owned(), group, lock: Arc::new(Lock(file)) })
    }

    /// Makes the page of a patch, in the place of one that an earlier daemon left.
    ///
    /// # Errors
    /// [`PageError`], where the system says no.
    pub fn page(&self, patch: &str, limits: Limits) -> Result<PageWriter, PageError> {
        PageWriter::create((&self.path, Arc::clone(&self.lock)), patch, limits, self.group)
    }
}

/// Whether what has the path is a folder of this account alone, and on a tmpfs.
fn private_in_memory(path: &Path) -> Result<(), PageError> {
    let about = std::fs::symlink_metadata(path).map_err(PageError::of(path, "looking at the folder"))?;
    if !about.is_dir() {
        return Err(PageError::refused(path, "is there and is not a folder"));
    }
    if about.uid() != geteuid().as_raw() || about.mode() & OTHERS_WRITE != 0 {
        let (owner, mode) = (about.uid(), about.mode() & 0o7777);
        let problem = format!(
            "others could put pages of their own there (it belongs to user {owner}, its mode is {mode:04o}): expected a \
             folder of this account in which nobody else writes; remove it, or name another in a folder where not \
             everybody may make one, as in /run/taxeld"
        );
        return Err(PageError::refused(path, problem));
    }
    let system = statfs(path).map_err(PageError::of(path, "looking at the file system"))?;
    if system.filesystem_type() != TMPFS_MAGIC {
        let why = "a disk could hold the engine up: expected a folder on a tmpfs, as in /dev/shm or /run";
        return Err(PageError::refused(path, why));
    }
    Ok(())
}

/// The group that may read pages may look into the folder.
fn make(path: &Path, group: Option<u32>) -> Result<(), PageError> {
    let mut builder = DirBuilder::new();
    builder.recursive(true).mode(0o755).create(path).map_err(PageError::of(path, "making the folder"))?;
    std::os::unix::fs::chown(path, None, group)
        .map_err(PageError::of(path, "giving the folder to the group, of which the daemon has to be a member"))?;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o750))
        .map_err(PageError::of(path, "setting the folder's mode"))
}
