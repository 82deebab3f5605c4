//! The runtime of each thread that serves something.

use tokio::runtime::Runtime;

/// A runtime on the thread that drives it. One thread wakes tasks without waking another thread, and takes them in the
/// order in which they were woken: what is due at the same tick on the streams of a connection is written at once.
///
/// # Errors
/// If the system has no more descriptors.
pub fn runtime() -> std::io::Result<Runtime> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()
}
