//! Where the log goes and what it looks like. On a terminal it has colours; under the journal it has no time of its own,
//! because the journal notes one.

use std::io::{self, IsTerminal, Write};
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;

use tracing_appender::non_blocking::{ErrorCounter, NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::fmt::writer::BoxMakeWriter;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, fmt};

/// What is logged unless somebody says otherwise.
const FILTER: &str = "info";

/// The variable that says otherwise.
const VARIABLE: &str = "RUST_LOG";

/// Before whatever filter there is these say errors alone: they warn of each frame and connection that a client spoils, as often
/// as it likes. What the service itself says of that is bounded (`taxel-rpc/src/refusals.rs`). A filter that names them decides.
const LIBRARIES: [&str; 6] = ["h2", "hyper", "hyper_util", "rustls", "tonic", "tower"];

/// What the names of our own crates begin with.
const OURS: &str = "taxel";

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

/// Counts the lines for which there was no room.
static DROPPED: OnceLock<ErrorCounter> = OnceLock::new();

/// The log of this process. Dropped, also by a panic, it waits a second for what is not written yet.
#[must_use]
pub struct Log(Option<(NonBlocking, WorkerGuard)>);

impl Log {
    /// Says why the programme fails, behind what was logged.
    pub fn failure(&mut self, why: &str) {
        let line = format!("taxeld: {why}\n");
        let _ = match &mut self.0 {
            Some((queue, _)) => queue.write_all(line.as_bytes()), // what has no room is counted
            None => io::stderr().lock().write_all(line.as_bytes()), // whether anybody reads it changes nothing
        };
    }
}

/// Starts the log on standard error; `RUST_LOG` says what is logged. That of a daemon has a thread of its own, so that the daemon
/// goes on whether anybody reads or not; else the thread that logs waits for the reader.
pub fn start(format: LogFormat, is_daemon: bool) -> Log {
    let queue = is_daemon.then(|| {
        let queue = NonBlockingBuilder::default().lossy(true).buffered_lines_limit(WAITING_LINES_MAX);
        let (queue, guard) = queue.thread_name("log").finish(Lines::default());
        let _ = DROPPED.set(queue.error_counter()); // called once
        (queue, guard)
    });
    let wanted = std::env::var_os(VARIABLE).map(|text| text.to_string_lossy().into_owned());
    let wanted = wanted.filter(|text| !text.trim().is_empty());
    let filter = wanted.as_deref().and_then(filter_of);
    let unused = wanted.filter(|_| filter.is_none());
    let filter = filter.or_else(|| filter_of(FILTER)).unwrap_or_default();
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
    if let Some(text) = unused {
        tracing::warn!(
            "{VARIABLE} = \"{text}\" is not used, but \"{FILTER}\": expected off, error, warn, info, debug or trace, or targets \
             with such levels, as in \"taxel_rpc=debug,info\""
        );
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

/// The filter that a text is: none where all but a misspelt level would be silent.
fn filter_of(text: &str) -> Option<EnvFilter> {
    // A level that is misspelt is a target, and all else would not be logged.
    let is_known = |word: &str| {
        let is_level = !word.is_empty() && word.parse::<LevelFilter>().is_ok();
        is_level || word.contains(['=', '[']) || word.starts_with(OURS)
    };
    let libraries: String = LIBRARIES.iter().map(|library| format!("{library}=error,")).collect();
    let filter = EnvFilter::try_new(format!("{libraries}{text}")).ok()?;
    text.split(',').map(str::trim).any(is_known).then_some(filter)
}

/// Whether standard error is the journal's. A terminal or file of a session may have the variable, too.
fn is_the_journal() -> bool {
    let own = std::fs::metadata("/proc/self/fd/2").map(|file| format!("{}:{}", file.dev(), file.ino()));
    own.is_ok_and(|own| std::env::var("JOURNAL_STREAM").is_ok_and(|named| named == own))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_warn_of_nothing_unless_the_filter_names_them_and_what_is_no_level_is_refused() {
        let shown = |text: &str| filter_of(text).unwrap().to_string();
        assert!(shown("info").contains("h2=error"));
        assert!(shown("h2=debug,info").contains("h2=debug") && !shown("h2=debug,info").contains("h2=error"));
        for text in ["wran", "", " , ", "warn,taxeld=nonsense[[", "taxeld=wran"] {
            assert!(filter_of(text).is_none(), "{text:?}");
        }
        for text in ["WARN", "off", "4", "taxel_rpc", "taxeld::bus", "tonic,info", "mio=trace,", "[span]=info"] {
            assert!(filter_of(text).is_some(), "{text:?}");
        }
    }
}
