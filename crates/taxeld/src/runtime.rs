//! The runtime of each thread that serves something.

use std::io;

use anyhow::Context;
use tokio::runtime::Runtime;

use crate::threads::start;

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: what is due at the same tick on the streams of a connection is written at once.
///
/// # Errors
/// If the system has no more descriptors.
pub fn runtime() -> io::Result<Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}

/// Starts a thread of this name that drives a runtime of its own.
///
/// # Errors
/// If there is no thread or no runtime to be had.
pub fn on_a_thread(name: &str, drive: impl FnOnce(Runtime) + Send + 'static) -> anyhow::Result<()> {
    let runtime = runtime().with_context(|| format!("a runtime for the thread `{name}`"))?;
    start(name, move || drive(runtime))
}
