//! Threads of the daemon by their names.

use std::thread;

use anyhow::Context;

/// Starts a thread of this name.
///
/// # Errors
/// The name, and the system's answer, if there is no thread to be had.
pub fn start(name: &str, run: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
    let started = thread::Builder::new().name(name.to_owned()).spawn(run);
    started.map(drop).with_context(|| format!("starting the thread `{name}`"))
}
