//! Where the log goes and what it looks like. On a terminal it has colours; under the journal it has no time of its own,
//! because the journal notes one.

use std::io::IsTerminal;
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt, reload};

/// What is logged unless somebody says otherwise.
const FILTER: &str = "info";

/// The variable that decides over the configuration.
const VARIABLE: &str = "RUST_LOG";

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

/// Starts the log on standard error; `RUST_LOG` says what is logged.
pub fn start(format: LogFormat) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(FILTER));
    let (filter, handle) = reload::Layer::new(filter);
    let lines = fmt::layer().with_writer(std::io::stderr).with_ansi(std::io::stderr().is_terminal());
    let lines = match (format, is_the_journal()) {
        (LogFormat::Text, false) => lines.boxed(),
        (LogFormat::Text, true) => lines.without_time().boxed(),
        (LogFormat::Json, false) => lines.json().boxed(),
        (LogFormat::Json, true) => lines.json().without_time().boxed(),
    };
    tracing_subscriber::registry().with(filter).with(lines).init();
    let _ = FILTERING.set(handle); // called once
}

/// Logs what this filter lets through from now on, unless `RUST_LOG` decides. Gives what applies now.
///
/// # Errors
/// What is wrong with the filter; nothing has changed then.
pub fn filter(wanted: Option<&str>) -> Result<String, String> {
    if let Ok(decided) = std::env::var(VARIABLE) {
        return Ok(format!("`{decided}`, which {VARIABLE} decides"));
    }
    let wanted = wanted.unwrap_or(FILTER);
    let filter = EnvFilter::try_new(wanted).map_err(|error| format!("log.filter = \"{wanted}\": {error}"))?;
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
