//! Looks after what others may take away while the daemon runs: pages in shared memory, Unix sockets.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio_util::sync::CancellationToken;

use crate::threads::start;

/// What is wrong at present, in words for the health. Clones are of the same.
#[derive(Clone, Debug, Default)]
pub struct Problems(Arc<Mutex<Vec<String>>>);

impl Problems {
    /// What is wrong.
    pub fn get(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// From now on this is.
    pub fn set(&self, words: Vec<String>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = words;
    }
}

/// Has `look` called each time `every` has gone by, on a thread of this name: the file system may take its time. Gives its end,
/// which comes with the daemon's, whatever a look waits for then.
///
/// # Errors
/// If there is no thread to be had.
pub fn look_after<L: FnMut() + Send + 'static>(
    name: &str,
    mut look: L,
    every: Duration,
    cancel: CancellationToken,
) -> anyhow::Result<impl Future<Output = ()> + use<L>> {
    let (stop, stopped) = channel::<()>();
    let keep = move || {
        while stopped.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
            look();
        }
    };
    start(name, keep)?;
    Ok(async move {
        cancel.cancelled().await;
        drop(stop);
    })
}
