//! Looks after what others may take away while the daemon runs: pages in shared memory, Unix sockets.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio_util::sync::CancellationToken;

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

/// Has `look` look after something each time `every` has gone by, until the daemon ends.
pub async fn look_after<T: Send + 'static>(
    mut kept: T,
    look: impl Fn(&mut T) + Copy + Send + 'static,
    every: Duration,
    cancel: CancellationToken,
) {
    while cancel.run_until_cancelled(tokio::time::sleep(every)).await.is_some() {
        // The file system may take its time, and the engine shares this thread. The end does not wait for it.
        let looking = tokio::task::spawn_blocking(move || {
            look(&mut kept);
            kept
        });
        match cancel.run_until_cancelled(looking).await {
            Some(Ok(looked)) => kept = looked,
            Some(Err(error)) => {
                tracing::error!(%error, "nobody looks after {} any more", std::any::type_name::<T>());
                break;
            }
            None => break,
        }
    }
    cancel.cancelled().await;
}
