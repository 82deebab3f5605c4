//! Where the log goes and what it looks like. On a terminal it has colours; under the journal it has no time of its own,
//! because the journal notes one.

use std::io::{self, IsTerminal, Write};
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;

use tracing_appender::non_blocking::{ErrorCounter, NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::fmt::writer::BoxMakeWriter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt, reload};

use taxel_skin::printable;

use crate::config::log_filter;
use crate::say;

/// What is logged unless somebody says otherwise.
const FILTER: &str = "info";

/// The variable that decides over the configuration.
const VARIABLE: &str = "RUST_LOG";

/// So much of a filter that is not used is shown.
const FILTER_CHARS_MAX: usize = 100;

/// Lines of the daemon that may wait for the reader of standard error: as many as a start and an hour of faults make.
const WAITING_LINES_MAX: usize = 4_096;

/// What a line of the log looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// The way to the filter of the running process.
static FILTERING: OnceLock<reload::Handle<EnvFilter, Registry>> = OnceLock::new();

/// Counts the lines for which there was no room.
static DROPPED: OnceLock<ErrorCounter> = OnceLock::new();

/// Who writes the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writes {
    /// Whoever logs, which waits for the reader.
    Itself,
    /// A thread of its own: the daemon goes on whether anybody reads or not.
    Thread,
}

/// The log of this process. Dropped, also by a panic, it waits a second for what is not written yet.
#[must_use]
pub struct Log(Option<(NonBlocking, WorkerGuard)>);

impl Log {
    /// Says why the programme fails, behind what was logged.
    pub fn failure(&mut self, why: &str) {
        let line = format!("taxeld: {}\n", say::short(why, say::FAILURE_CHARS_MAX));
        let _ = match &mut self.0 {
            Some((queue, _)) => queue.write_all(line.as_bytes()), // what has no room is counted
            None => io::stderr().lock().write_all(line.as_bytes()), // whether anybody reads it changes nothing
        };
    }
}

/// Starts the log on standard error; `RUST_LOG` says what is logged.
pub fn start(format: LogFormat, writes: Writes) -> Log {
    let queue = (writes == Writes::Thread).then(|| {
        let queue = NonBlockingBuilder::default().lossy(true).buffered_lines_limit(WAITING_LINES_MAX);
        let (queue, guard) = queue.thread_name("log").finish(Lines::default());
        let _ = DROPPED.set(queue.error_counter()); // called once
        (queue, guard)
    });
    let decided = decided();
    let filter = decided.as_ref().ok().cloned().flatten().and_then(|text| log_filter(&text).ok());
    let filter = filter.or_else(|| log_filter(FILTER).ok()).unwrap_or_default();
    let (filter, handle) = reload::Layer::new(filter);
    let writer = match &queue {
        Some((queue, _)) => BoxMakeWriter::new(queue.clone()),
        None => BoxMakeWriter::new(io::stderr),
    };
    let lines = fmt::layer().with_writer(writer).with_ansi(io::stderr().is_terminal());
    let lines = match (format, is_the_journal()) {
        (LogFormat::Text, false) => lines.boxed(),
        (LogFormat::Text, true) => lines.without_time().boxed(),
        (LogFormat::Json, false) => lines.json().boxed(),
        (LogFormat::Json, true) => lines.json().without_time().boxed(),
    };
    tracing_subscriber::registry().with(filter).with(lines).init();
    let _ = FILTERING.set(handle); // called once
    if let Err(why) = decided {
        tracing::warn!("{why}");
    }
    Log(queue)
}

/// Writes the lines of the queue, and tells how many were dropped once no more are.
#[derive(Default)]
struct Lines {
    /// Dropped when a line was last written.
    seen: usize,
    /// Dropped when it was last told.
    told: usize,
}

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let dropped = DROPPED.get().map_or(0, ErrorCounter::dropped_lines);
        if std::mem::replace(&mut self.seen, dropped) == dropped && dropped > self.told {
            let lines = dropped - std::mem::replace(&mut self.told, dropped);
            tracing::warn!("{lines} lines of the log were dropped, since nobody read them"); // comes last in the queue
        }
        io::stderr().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// The filter of the variable; nothing where it is not set, or empty.
///
/// # Errors
/// What is wrong with it.
fn decided() -> Result<Option<String>, String> {
    let Some(value) = std::env::var_os(VARIABLE) else { return Ok(None) };
    let text = value.to_string_lossy();
    if text.trim().is_empty() {
        return Ok(None);
    }
    let unused = |why: String| {
        let shown = printable(say::short(&text, FILTER_CHARS_MAX).as_str());
        format!("{VARIABLE} = \"{shown}\" of the environment is not used, but `log.filter` of the configuration: {why}")
    };
    log_filter(&text).map_err(unused)?;
    Ok(Some(text.into_owned()))
}

/// Logs what this filter lets through from now on, unless `RUST_LOG` decides. Gives what applies now.
///
/// # Errors
/// What is wrong with the filter; nothing has changed then.
pub fn filter(wanted: Option<&str>) -> Result<String, String> {
    if let Ok(Some(decided)) = decided() {
        return Ok(format!("`{decided}`, which {VARIABLE} decides"));
    }
    let wanted = wanted.unwrap_or(FILTER);
    let filter = log_filter(wanted)?; // of a configuration that was checked
    if let Some(handle) = FILTERING.get() {
        handle.reload(filter).map_err(|error| error.to_string())?;
    }
    Ok(format!("`{wanted}`"))
}

/// Whether standard error is the journal's: it names its device and its number.
fn is_the_journal() -> bool {
    let stream = std::env::var("JOURNAL_STREAM").unwrap_or_default();
    let named = stream.split_once(':').and_then(|(device, inode)| Some((device.parse().ok()?, inode.parse().ok()?)));
    let own = std::fs::metadata("/proc/self/fd/2").ok().map(|file| (file.dev(), file.ino()));
    named.is_some() && own == named
}
