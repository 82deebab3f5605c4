//! The daemon's side: the one writer of a page.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::clock::now_ns;
use crate::error::PageError;
use crate::force::Limits;
use crate::latch;
use crate::layout::{
    AT_AGE_LIMIT, AT_BEAT, AT_BEAT_LIMIT, AT_CLOSED, AT_MAGIC, AT_VERSION_AND_BYTES, MAGIC, PAGE_BYTES, VERSION,
    encode, pair,
};
use crate::map::Map;
use crate::sample::Sample;

/// The daemon writes a page, its group reads it.
const MODE: u32 = 0o640;

/// That this process alone publishes there, also for as long as there is a page.
#[derive(Debug)]
pub(crate) struct Lock(pub(crate) File);

impl Drop for Lock {
    /// To close the file would not be enough: a process that another thread starts just now has a copy of it until it runs its
    /// own program, and keeps the lock with that.
    fn drop(&mut self) {
        let _ = self.0.unlock(); // it fails where the system has lost the file, and the lock with that
    }
}

/// Writes a page: some hundred bytes of memory a sample, no system call but that of the clock, no waiting.
///
/// When it is dropped the page says so and loses its name.
#[derive(Debug)]
pub struct PageWriter {
    map: Map,
    path: PathBuf,
    /// Held for as long as there is a page.
    _lock: Arc<Lock>,
}

impl PageWriter {
    /// Makes the page under a name of its own and then gives it that of the patch, so that nobody sees half of it, and
    /// a reader of an older page keeps that.
    pub(crate) fn create(
        (folder, lock): (&Path, Arc<Lock>),
        patch: &str,
        limits: Limits,
        group: Option<u32>,
    ) -> Result<Self, PageError> {
        let path = folder.join(patch);
        let new = folder.join(format!(".{patch}.new"));
        let _ = std::fs::remove_file(&new); // of a daemon that was killed at this very place; else it is not there
        let made = make(&new, limits, group).and_then(|made| {
            std::fs::rename(&new, &path).map_err(PageError::of(&path, "naming the page"))?;
            Ok(made)
        });
        let map = made.inspect_err(|_| _ = std::fs::remove_file(&new))?; // the first error is what is told
        Ok(Self { map, path, _lock: lock })
    }

    /// Where the page is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the next sample.
    pub fn write(&mut self, sample: &Sample) {
        let now_ns = now_ns();
        latch::write(self.map.words(), &encode(&Sample { written_ns: now_ns, ..*sample }));
        self.map.words()[AT_BEAT].store(now_ns.cast_unsigned(), Ordering::Relaxed);
    }

    /// Says that the writer is alive. Due more often than the limit of the page.
    pub fn beat(&self) {
        self.map.words()[AT_BEAT].store(now_ns().cast_unsigned(), Ordering::Relaxed);
    }
}

/// Makes the file of a page, complete but for its name.
fn make(new: &Path, limits: Limits, group: Option<u32>) -> Result<Map, PageError> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create_new(true).mode(0o600);
    let mut file = options.open(new).map_err(PageError::of(new, "making the page"))?;
    // Written and not only sized, so that the memory is there, and its want is told here and not by a signal later.
    file.write_all(&[0; PAGE_BYTES]).map_err(PageError::of(new, "making the page"))?;
    let map = Map::for_writing(&file).map_err(PageError::of(new, "mapping the page"))?;
    let ns = |span: Duration| u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
    let header = [
        (AT_MAGIC, u64::from_ne_bytes(MAGIC)),
        (AT_VERSION_AND_BYTES, pair(VERSION, PAGE_BYTES as u32)),
        (AT_AGE_LIMIT, ns(limits.age)),
        (AT_BEAT_LIMIT, ns(limits.beat)),
        (AT_BEAT, now_ns().cast_unsigned()),
    ];
    header.iter().for_each(|&(at, word)| map.words()[at].store(word, Ordering::Relaxed));
    std::os::unix::fs::fchown(&file, None, group)
        .map_err(PageError::of(new, "giving the page to the group, of which the daemon has to be a member"))?;
    file.set_permissions(std::fs::Permissions::from_mode(MODE))
        .map_err(PageError::of(new, "setting the page's mode"))?;
    Ok(map)
}

impl Drop for PageWriter {
    fn drop(&mut self) {
        self.map.words()[AT_CLOSED].store(1, Ordering::Release);
        let _ = std::fs::remove_file(&self.path); // the page itself says that it is over
    }
}
