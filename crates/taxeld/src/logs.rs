//! Where the log goes and what it looks like. On a terminal it has colours; under the journal it has no time of its own,
//! because the journal notes one.

mod lines;
mod queue;

use std::backtrace::{Backtrace, BacktraceStatus};
use std::io::IsTerminal;
use std::os::unix::fs::MetadataExt;
use std::panic::PanicHookInfo;
use std::sync::OnceLock;
use std::time::Duration;

use lines::Waiting;
use queue::{LogQueue, Lost};
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

/// What waits for the reader of standard error, where nobody may be held up by it.
static QUEUE: OnceLock<LogQueue> = OnceLock::new();

/// At its end a process waits so long for the reader of its log.
const FLUSH_WITHIN: Duration = Duration::from_secs(1);

/// Who writes the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writes {
    /// Whoever logs, which waits for the reader.
    Itself,
    /// A thread of its own: the daemon goes on whether anybody reads or not.
    Thread,
}

/// The log of this process. Dropped, also by a panic, it waits a moment for what is not written yet.
#[must_use]
pub struct Log(());

impl Drop for Log {
    fn drop(&mut self) {
        if let Some(queue) = QUEUE.get() {
            queue.flush(FLUSH_WITHIN); // a reader that has not read by then does not hold up the end either
        }
    }
}

/// Starts the log on standard error; `RUST_LOG` says what is logged.
pub fn start(format: LogFormat, writes: Writes) -> Log {
    if writes == Writes::Thread {
        match LogQueue::start(Waiting(std::io::stderr()), tell_lost) {
            Ok(queue) => {
                let _ = QUEUE.set(queue); // called once
                crate::say::lead_errors_to(queued);
                std::panic::set_hook(Box::new(tell_panic));
            }
            Err(error) => crate::say::failure(&format!("no thread for the log, which may hold the daemon up: {error}")),
        }
    }
    let decided = decided();
    let filter = decided.as_ref().ok().cloned().flatten().and_then(|text| log_filter(&text).ok());
    let filter = filter.or_else(|| log_filter(FILTER).ok()).unwrap_or_default();
    let (filter, handle) = reload::Layer::new(filter);
    let writer = match QUEUE.get() {
        Some(queue) => BoxMakeWriter::new(|| queue.clone()),
        None => BoxMakeWriter::new(std::io::stderr),
    };
    let lines = fmt::layer().with_writer(writer).with_ansi(std::io::stderr().is_terminal());
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
    Log(())
}

/// Puts a line of text for standard error behind what is logged, where that has a queue. Whether it has.
fn queued(text: std::fmt::Arguments<'_>) -> bool {
    QUEUE.get().inspect(|queue| queue.put(format!("{text}\n").as_bytes())).is_some()
}

fn tell_lost(lost: &Lost) {
    lost.words().iter().for_each(|words| tracing::warn!("{words}"));
}

/// As the standard library tells of a panic, but without waiting for the reader.
fn tell_panic(panic: &PanicHookInfo<'_>) {
    let thread = std::thread::current();
    let name = thread.name().unwrap_or("without a name");
    let trace = Backtrace::capture();
    let trace = if trace.status() == BacktraceStatus::Captured { format!("\n{trace}") } else { String::new() };
    queued(format_args!("thread '{name}' {panic}{trace}"));
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
