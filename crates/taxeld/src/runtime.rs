//! The runtime of each thread that serves something.

use std::io;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use anyhow::Context;
use tokio::runtime::Runtime;

use crate::threads::start;

/// Longer than any daemon runs.
const FOREVER: Duration = Duration::from_secs(100 * 365 * 24 * 3600);

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: what is due at the same tick on the streams of a connection is written at once.
///
/// It has a second thread for what blocks, such as a fit or the closing of the store, and keeps it: where the system has no
/// further one, such work waits for this one's turn. Without any, tokio takes what it does not get for a fault of the programme.
///
/// # Errors
/// If the system has no more descriptors, or no thread.
pub fn runtime() -> io::Result<Runtime> {
    // Whether there is one to be had: asked of tokio, it would panic.
    let tried = thread::Builder::new().spawn(|| ())?;
    tried.join().map_err(|_| io::Error::other("a thread that does nothing panicked"))?;
    let mut builder = tokio::runtime::Builder::new_current_thread();
    let runtime = builder.enable_all().thread_keep_alive(FOREVER).build()?;
    runtime.spawn_blocking(|| ());
    Ok(runtime)
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
