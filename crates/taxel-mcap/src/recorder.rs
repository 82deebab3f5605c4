//! The recorder's thread: takes what waits, writes it, begins new files and lets old ones go.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::file::{McapFault, McapFile, Topic};
use crate::folder::Folder;
use crate::queue::{Item, Queue, Shared, Status, Waiting};

/// Kept free of the budget for what is written until the next look at it: chunks of a MiB, and a file's summary.
const RESERVE_BYTES: u64 = 4 << 20;

/// After so many bytes the next look is due before its time.
const LOOK_BYTES: u64 = 1 << 20;

/// Owner writes, group reads.
const MODE: u32 = 0o640;

/// What a recording may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// All recordings of the folder together, in bytes, from 16 MiB on.
    pub budget_bytes: u64,
    /// A file that is larger is ended, in bytes; at most half of the budget.
    pub file_bytes: u64,
    /// A file that is older is ended.
    pub file_age: Duration,
    /// With less space on the disk nothing is recorded, in bytes.
    pub keep_free_bytes: u64,
    /// What was gathered goes to the disk after so long.
    pub flush_every: Duration,
    /// A disk that failed is tried again after so long.
    pub retry_after: Duration,
}

/// Makes a new file.
pub type Opener = Box<dyn FnMut(&Path) -> io::Result<File> + Send>;

/// Makes a new file on the disk; one that is there already is an error.
///
/// # Errors
/// The system's answer.
pub fn open_file(path: &Path) -> io::Result<File> {
    File::options().write(true).create_new(true).mode(MODE).open(path)
}

/// A recording under way. Dropped, it ends: what was given before is written and the file closed.
pub struct Recorder {
    stop: Arc<AtomicBool>,
    status: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Starts the thread. Gives where things to record go.
    ///
    /// # Errors
    /// If there is no thread to be had. A disk that fails, now or later, is told in the status.
    pub fn start(
        folder: Folder,
        limits: Limits,
        topics: Vec<Topic>,
        about: BTreeMap<String, String>,
        opener: Opener,
    ) -> io::Result<(Self, Queue)> {
        let status = Arc::new(Shared::default());
        let (queue, waiting) = Queue::new(Arc::clone(&status));
        let stop = Arc::new(AtomicBool::new(false));
        let worker = Worker {
            folder,
            limits,
            topics,
            about,
            opener,
            status: Arc::clone(&status),
            open: None,
            next_look: Instant::now(),
            retry_at: Instant::now(),
        };
        let stopped = Arc::clone(&stop);
        let run = move || worker.run(&waiting, &stopped);
        let thread = std::thread::Builder::new().name("recorder".to_owned()).spawn(run)?;
        Ok((Self { stop, status, thread: Some(thread) }, queue))
    }

    /// What it is at. May be asked by several; each gets its own.
    pub fn status(&self) -> impl Fn() -> Status + Send + Sync + use<> {
        let status = Arc::clone(&self.status);
        move || status.get().clone()
    }

    /// Ends the recording and waits until its file is closed.
    pub fn finish(mut self) -> Status {
        self.end();
        self.status.get().clone()
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the recorder's thread panicked");
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.end();
    }
}

/// The file that is being written.
struct Open {
    file: McapFile,
    path: PathBuf,
    begun: Instant,
    /// Things in it, and those of them that are not yet on the disk.
    things: u64,
    unflushed: u64,
    /// Its size at the last look.
    looked_bytes: u64,
}

/// What the thread holds.
struct Worker {
    folder: Folder,
    limits: Limits,
    topics: Vec<Topic>,
    about: BTreeMap<String, String>,
    opener: Opener,
    status: Arc<Shared>,
    open: Option<Open>,
    next_look: Instant,
    retry_at: Instant,
}

impl Worker {
    fn run(mut self, waiting: &Waiting, stop: &AtomicBool) {
        self.look(); // what waits already finds a file
        while !stop.load(Ordering::Relaxed) {
            // A stop is seen at the next look at the latest.
            let pause = self.next_look.saturating_duration_since(Instant::now()).min(Duration::from_millis(100));
            match waiting.next(pause) {
                Ok(Some(item)) => self.take(item),
                Ok(None) => {}
                Err(()) => break,
            }
            if Instant::now() >= self.next_look {
                self.look();
            }
        }
        while let Ok(Some(item)) = waiting.next(Duration::ZERO) {
            self.take(item);
        }
        if let Err(why) = self.flushed() {
            self.failed(&why);
        }
        self.close();
    }

    /// Everything that was taken is on the disk, in a file that somebody finds: it may have been removed.
    fn flushed(&mut self) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        fs::metadata(&open.path).map_err(|error| format!("{}: {error}", open.path.display()))?;
        open.file.flush().map_err(|fault| fault.words())?;
        open.unflushed = 0;
        open.looked_bytes = open.file.bytes();
        Ok(())
    }

    fn take(&mut self, item: Item) {
        let Some(open) = &mut self.open else {
            self.status.get().lost += item.things;
            return;
        };
        open.things += item.things;
        open.unflushed += item.things;
        let written = open.file.write(item.topic, item.log_ns, &(item.encode)());
        let grown = open.file.bytes().saturating_sub(open.looked_bytes);
        match written {
            Err(fault) => self.failed(&fault.words()),
            Ok(()) if grown > LOOK_BYTES => self.look(),
            Ok(()) => {}
        }
    }

    /// Sees to everything that is due from time to time.
    fn look(&mut self) {
        self.next_look = Instant::now() + self.limits.flush_every;
        if self.open.is_none() && Instant::now() < self.retry_at {
            return;
        }
        if let Err(why) = self.looked() {
            self.failed(&why);
        }
        self.status.get().bytes = self.folder.bytes();
    }

    fn looked(&mut self) -> Result<(), String> {
        self.flushed()?;
        if let Some(open) = &self.open {
            let full = open.looked_bytes >= self.limits.file_bytes;
            if full || (open.begun.elapsed() >= self.limits.file_age && open.things > 0) {
                self.close();
            }
        }
        let path = self.folder.path().display().to_string();
        fs::create_dir_all(self.folder.path()).map_err(|error| format!("{path}: {error}"))?;
        let budget = self.limits.budget_bytes.saturating_sub(RESERVE_BYTES);
        let gone = self.folder.keep(budget).map_err(|error| format!("an old recording cannot be deleted: {error}"))?;
        if gone > 0 {
            tracing::debug!(gone, "old recordings were deleted to stay within the budget");
        }
        let free = self.folder.free_bytes().map_err(|error| error.to_string())?;
        if free < self.limits.keep_free_bytes {
            let [free, keep] = [free, self.limits.keep_free_bytes].map(|bytes| bytes / 1_000_000);
            return Err(format!("the disk has {free} MB left, {keep} MB are kept free"));
        }
        if self.open.is_none() {
            self.begin().map_err(|fault| format!("{path}: {}", fault.words()))?;
        }
        Ok(())
    }

    fn begin(&mut self) -> Result<(), McapFault> {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let path = self.folder.next_file(i64::try_from(since_1970.as_nanos()).unwrap_or(i64::MAX))?;
        let new = (self.opener)(&path)?;
        // What could not even be begun is not left, if it can be removed.
        let file =
            McapFile::begin(new, &self.topics, self.about.clone()).inspect_err(|_| drop(fs::remove_file(&path)))?;
        let (name, looked_bytes) = (path.display().to_string(), file.bytes());
        self.open = Some(Open { file, path, begun: Instant::now(), things: 0, unflushed: 0, looked_bytes });
        // Nothing is logged under the lock: the engine's thread may wait for it, and a log may be slow.
        let news = {
            let mut status = self.status.get();
            let news = status.problem.take().is_some() || status.file.is_empty();
            status.file.clone_from(&name);
            news
        };
        if news {
            tracing::info!(file = name, "recording");
        }
        Ok(())
    }

    /// Ends the present file, of which all is on the disk, with its summary.
    fn close(&mut self) {
        let Some(open) = self.open.take() else { return };
        if let Err(fault) = open.file.finish() {
            // Its chunks are whole and it can be read, but for the summary.
            tracing::warn!(why = fault.words(), "a recording could not be closed cleanly");
        }
        self.status.get().bytes = self.folder.bytes();
    }

    /// The disk does not take it: everything but the recording goes on.
    fn failed(&mut self, why: &str) {
        self.retry_at = Instant::now() + self.limits.retry_after;
        let mut lost = 0;
        if let Some(open) = self.open.take() {
            lost = open.unflushed;
            open.file.give_up();
        }
        let bytes = self.folder.bytes();
        let news = {
            let mut status = self.status.get();
            status.lost += lost;
            status.bytes = bytes;
            status.problem.replace(why.to_owned()).as_deref() != Some(why)
        };
        if news {
            let seconds = self.limits.retry_after.as_secs();
            tracing::error!(why, "the recording stopped; it is tried again every {seconds} s");
        }
    }
}
