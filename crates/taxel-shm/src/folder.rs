//! The folder in which one daemon publishes its pages.

use std::fs::{DirBuilder, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nix::sys::statfs::{TMPFS_MAGIC, statfs};
use nix::unistd::geteuid;

use crate::error::PageError;
use crate::force::Limits;
use crate::layout::{MAGIC, PAGE_BYTES};
use crate::lock::Lock;
use crate::permissions::Permissions;
use crate::writer::PageWriter;

/// Locked for as long as a daemon publishes in the folder.
const LOCK: &str = ".lock";

/// A folder that this process alone publishes in.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    permissions: Permissions,
    lock: Arc<Lock>,
}

impl Folder {
    /// Takes the folder, made if it is not there, and removes the pages that an earlier daemon left in it.
    ///
    /// # Errors
    /// [`PageError`]: it is not on a tmpfs, not this account's alone to write in, or another daemon publishes there.
    pub fn open(path: &Path, permissions: Permissions) -> Result<Self, PageError> {
        if std::fs::symlink_metadata(path).is_err() {
            make(path, permissions)?;
        }
        private_in_memory(path)?;
        let at = path.join(LOCK);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600).custom_flags(nix::libc::O_NOFOLLOW);
        let lock = options.open(&at).map_err(PageError::of(&at, "opening the lock"))?;
        let lock = Lock::take(lock).map_err(|error| match error {
            TryLockError::WouldBlock => wrong(path, "another daemon publishes its pages there"),
            TryLockError::Error(source) => PageError::of(&at, "locking")(source),
        })?;
        let folder = Self { path: path.to_owned(), permissions, lock: Arc::new(lock) };
        folder.remove_leftovers()?;
        Ok(folder)
    }

    /// Looks whether pages could be in the folder, or in one that would be made. Nothing is changed, and whether another daemon
    /// has the folder is not asked.
    ///
    /// # Errors
    /// [`PageError`], as [`Folder::open`].
    pub fn check(path: &Path) -> Result<(), PageError> {
        match std::fs::symlink_metadata(path) {
            Ok(_) => return private_in_memory(path),
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
            Err(error) => return Err(PageError::of(path, "looking at the folder")(error)),
        }
        let Some(there) = path.ancestors().skip(1).find(|folder| folder.exists()) else { return Ok(()) };
        if !there.is_dir() {
            return Err(wrong(path, &format!("{} is not a folder", there.display())));
        }
        in_memory(path, there)
    }

    /// Makes the page of a patch.
    ///
    /// # Errors
    /// [`PageError`], where the system says no.
    pub fn page(&self, patch: &str, limits: Limits) -> Result<PageWriter, PageError> {
        PageWriter::create((&self.path, Arc::clone(&self.lock)), patch, limits, self.permissions)
    }

    /// A daemon that was killed leaves its pages. Whoever reads them sees that nobody is behind them; a name that is not
    /// used again would stay for ever.
    fn remove_leftovers(&self) -> Result<(), PageError> {
        let entries = std::fs::read_dir(&self.path).map_err(PageError::of(&self.path, "listing the folder"))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            let mut begin = [0; MAGIC.len()];
            let Ok(mut file) = OpenOptions::new().read(true).custom_flags(nix::libc::O_NONBLOCK).open(&path) else {
                continue;
            };
            let is_page = file.metadata().is_ok_and(|about| about.is_file() && about.len() == PAGE_BYTES as u64);
            if is_page && file.read_exact(&mut begin).is_ok() && begin == MAGIC {
                std::fs::remove_file(&path).map_err(PageError::of(&path, "removing an old page"))?;
            }
        }
        Ok(())
    }
}

fn wrong(path: &Path, problem: &str) -> PageError {
    PageError::Folder { path: path.to_owned(), problem: problem.to_owned() }
}

/// Whether what has the path is a folder of this account alone, and on a tmpfs.
fn private_in_memory(path: &Path) -> Result<(), PageError> {
    let occupied = |problem: &str| PageError::Occupied { path: path.to_owned(), problem: problem.to_owned() };
    let about = std::fs::symlink_metadata(path).map_err(PageError::of(path, "looking at the folder"))?;
    if !about.is_dir() {
        return Err(occupied("is there and is not a folder"));
    }
    if about.uid() != geteuid().as_raw() || about.mode() & 0o022 != 0 {
        let (owner, mode) = (about.uid(), about.mode() & 0o7777);
        return Err(occupied(&format!(
            "others could put pages of their own there (it belongs to user {owner}, its mode is {mode:04o}): expected a \
             folder of this account in which nobody else writes; remove it, or name another in a folder where not \
             everybody may make one, as in /run/taxeld"
        )));
    }
    in_memory(path, path)
}

/// Whether the folder that is there is on a tmpfs; `path` is the one of the pages, in it or the same.
fn in_memory(path: &Path, there: &Path) -> Result<(), PageError> {
    let system = statfs(there).map_err(|error| PageError::of(there, "looking at the file system")(error.into()))?;
    if system.filesystem_type() != TMPFS_MAGIC {
        let why = "a disk could hold the engine up: expected a folder on a tmpfs, as in /dev/shm or /run";
        return Err(wrong(path, why));
    }
    Ok(())
}

/// Whoever may read pages may look into the folder.
fn make(path: &Path, permissions: Permissions) -> Result<(), PageError> {
    let mut builder = DirBuilder::new();
    builder.recursive(true).mode(0o755).create(path).map_err(PageError::of(path, "making the folder"))?;
    if permissions.group.is_some() {
        std::os::unix::fs::chown(path, None, permissions.group)
            .map_err(PageError::of(path, "giving the folder to the group, of which the daemon has to be a member"))?;
    }
    let mode = if permissions.mode & 0o004 != 0 { 0o755 } else { 0o750 };
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode))
        .map_err(PageError::of(path, "setting the folder's mode"))
}
