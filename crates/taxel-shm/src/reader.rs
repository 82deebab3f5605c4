//! A controller's side: the newest force of a page, judged now.

use std::fs::OpenOptions;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::clock::now_ns;
use crate::error::PageError;
use crate::folder::OTHERS_WRITE;
use crate::force::{Force, Limits, NoForce, judge};
use crate::latch;
use crate::layout::{
    AT_AGE_LIMIT, AT_BEAT, AT_BEAT_LIMIT, AT_CLOSED, AT_MAGIC, AT_VERSION_AND_BYTES, MAGIC, PAGE_BYTES, VERSION,
    decode, unpair,
};
use crate::map::Map;
use crate::sample::Sample;

/// How often a [`Reader`] without a living page looks for a new one.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// One page of one run of a daemon. Reading it takes no system call but that of the clock, which Linux answers without
/// entering the kernel.
#[derive(Debug)]
pub struct Page {
    map: Map,
    limits: Limits,
    file: (u64, u64),
}

impl Page {
    /// Maps the page of this file, read-only.
    ///
    /// # Errors
    /// [`PageError`], if there is none, it may not be read, others may write in it or in its folder, or its layout is another one.
    pub fn open(path: &Path) -> Result<Self, PageError> {
        // What is no file must not hold a control loop up, as a pipe would.
        let mut options = OpenOptions::new();
        let file = options.read(true).custom_flags(nix::libc::O_NONBLOCK).open(path);
        let file = file.map_err(PageError::of(path, "opening the page"))?;
        let about = file.metadata().map_err(PageError::of(path, "looking at the page"))?;
        let wrong = |problem: String| PageError::refused(path, problem);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let of_folder = std::fs::metadata(folder).map_err(PageError::of(folder, "looking at the folder"))?;
        if (about.mode() | of_folder.mode()) & OTHERS_WRITE != 0 {
            return Err(wrong("others may write in it or in its folder: expected those of a daemon alone".to_owned()));
        }
        if !about.is_file() || about.len() < PAGE_BYTES as u64 {
            return Err(wrong(format!("{} bytes, expected a file of {PAGE_BYTES}", about.len())));
        }
        let map = Map::for_reading(&file).map_err(PageError::of(path, "mapping the page"))?;
        let word = |at: usize| map.words()[at].load(Ordering::Relaxed);
        if word(AT_MAGIC).to_ne_bytes() != MAGIC {
            return Err(wrong("this is not a page of taxeld".to_owned()));
        }
        let (version, bytes) = unpair(word(AT_VERSION_AND_BYTES));
        if (version, bytes as usize) != (VERSION, PAGE_BYTES) {
            return Err(wrong(format!(
                "layout {version} of {bytes} bytes, this reader knows {VERSION} of {PAGE_BYTES}"
            )));
        }
        let limits =
            Limits { age: Duration::from_nanos(word(AT_AGE_LIMIT)), beat: Duration::from_nanos(word(AT_BEAT_LIMIT)) };
        Ok(Self { map, limits, file: (about.dev(), about.ino()) })
    }

    /// The newest sample as it was written, good or not; `None` before the first one. Not for controllers.
    #[must_use]
    pub fn newest(&self) -> Option<Sample> {
        latch::read(self.map.words()).map(|(_, words)| decode(&words))
    }

    /// The newest force, if it may be acted on now: whole, of a living daemon, of state OK or DEGRADED, and no older than
    /// the daemon's limit, or than `age_max` if that is less.
    ///
    /// # Errors
    /// [`NoForce`]: why it may not.
    pub fn force(&self, age_max: Option<Duration>) -> Result<Force, NoForce> {
        let word = |at: usize| self.map.words()[at].load(Ordering::Relaxed);
        let sample = self.newest();
        let beat_ns = word(AT_BEAT).cast_signed();
        if word(AT_CLOSED) != 0 {
            return Err(NoForce::Closed);
        }
        let age = age_max.map_or(self.limits.age, |own| own.min(self.limits.age));
        // The clock is read last: nothing that was found can be of a later moment, unless it has another clock.
        judge(&sample.ok_or(NoForce::NothingYet)?, beat_ns, now_ns(), Limits { age, ..self.limits })
    }
}

/// Follows a patch over restarts of its daemon: a daemon that starts makes a new page under the same name.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    age_max: Option<Duration>,
    page: Option<Page>,
    look_at_ns: i64,
}

impl Reader {
    /// A reader of the page at `path`, which need not be there yet. `age_max` is the caller's own limit, if it has a
    /// stricter one than the daemon.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>, age_max: Option<Duration>) -> Self {
        Self { path: path.into(), age_max, page: None, look_at_ns: i64::MIN }
    }

    /// The newest force, if it may be acted on now. While there is no living page it looks for a new one, at most every
    /// 50 ms, which takes a few system calls.
    ///
    /// # Errors
    /// [`NoForce`]: why there is none.
    pub fn force(&mut self) -> Result<Force, NoForce> {
        let judged = self.judged();
        // A page without a sample may be that of a daemon that was killed as it started.
        let lost =
            matches!(judged, Err(NoForce::NoPage | NoForce::NothingYet | NoForce::Closed | NoForce::WriterGone(_)));
        if lost && self.finds_another() { self.judged() } else { judged }
    }

    fn judged(&self) -> Result<Force, NoForce> {
        self.page.as_ref().map_or(Err(NoForce::NoPage), |page| page.force(self.age_max))
    }

    /// Whether there is a page under the name that is not the present one, which it then is.
    fn finds_another(&mut self) -> bool {
        let now_ns = now_ns();
        if now_ns < self.look_at_ns {
            return false;
        }
        self.look_at_ns = now_ns.saturating_add(LOOK_EVERY.as_nanos() as i64);
        let other = |page: &Page| self.page.as_ref().is_none_or(|known| known.file != page.file);
        let found = Page::open(&self.path).ok().filter(other);
        let is_found = found.is_some();
        self.page = found.or(self.page.take());
        is_found
    }
}
