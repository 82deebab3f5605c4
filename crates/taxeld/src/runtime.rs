//! The runtime of each thread that serves something.

use std::sync::mpsc;

use anyhow::Context;
use tokio::runtime::Runtime;

use crate::threads::start;

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: what is due at the same tick on the streams of a connection is written at once.
///
/// # Errors
/// If the system has no more descriptors.
pub fn runtime() -> std::io::Result<Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}

/// Starts a thread of this name that drives a runtime of its own.
///
/// The thread comes first, and is handed the runtime: one that no thread takes would be dropped here, which tokio takes for a
/// fault of the programme where another runtime is being driven.
///
/// # Errors
/// If there is no thread or no runtime to be had.
pub fn on_a_thread(name: &str, drive: impl FnOnce(Runtime) + Send + 'static) -> anyhow::Result<()> {
    let (give, given) = mpsc::channel();
    let begin = move || given.recv().map_or((), drive); // without a runtime it ends
    start(name, begin)?;
    let runtime = runtime().with_context(|| format!("a runtime for the thread `{name}`"))?;
    let _ = give.send(runtime); // it waits for it
    Ok(())
}
