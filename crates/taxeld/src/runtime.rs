//! Threads of the daemon by their names, and the runtime of each that serves something.

use std::{io, thread};

use anyhow::Context;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: what is due at the same tick on the streams of a connection is written at once.
///
/// # Errors
/// If the system has no more descriptors.
pub fn runtime() -> io::Result<Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}

/// Starts a thread of this name.
///
/// # Errors
/// The name, and the system's answer, if there is no thread to be had.
pub fn start(name: &str, run: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
    let started = thread::Builder::new().name(name.to_owned()).spawn(run);
    started.map(drop).with_context(|| format!("starting the thread `{name}`"))
}

/// Runs a task on a thread of this name and a runtime of its own. Gives its end.
///
/// # Errors
/// If there is no thread or no runtime to be had.
pub fn on_a_thread<F>(
    name: &'static str,
    task: F,
) -> anyhow::Result<impl Future<Output = anyhow::Result<F::Output>> + use<F>>
where
    F: Future<Output: Send + 'static> + Send + 'static,
{
    let runtime = runtime().with_context(|| format!("a runtime for the thread `{name}`"))?;
    let (ended, end) = oneshot::channel();
    start(name, move || {
        let _ = ended.send(runtime.block_on(task)); // the daemon did not wait for it
    })?;
    Ok(async move { end.await.with_context(|| format!("the thread `{name}` ended by a fault of this program")) })
}
