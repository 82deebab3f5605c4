//! The tasks of a daemon, and how they end.

use std::time::Duration;

use anyhow::anyhow;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::bus::BusEnd;

/// After the end was asked for, the tasks have this long to close.
const CLOSE_WITHIN: Duration = Duration::from_secs(5);

/// All tasks of a daemon, from the first that is started on: with one of them the store is closed, so that they are closed on
/// every way out, also where a start fails.
#[derive(Default)]
pub struct Tasks {
    /// Tells all of them to end.
    pub cancel: CancellationToken,
    /// Engine, service and whatever else is beside the buses.
    pub parts: Parts,
    /// One for each bus.
    pub buses: JoinSet<BusEnd>,
}

/// Parts of a daemon; where one of them ends, the others do.
#[derive(Default)]
pub struct Parts(JoinSet<anyhow::Result<()>>);

impl Parts {
    /// Starts one that ends by itself only when all is to end.
    pub fn spawn(&mut self, part: impl Future<Output = ()> + Send + 'static) {
        self.spawn_fallible(async {
            part.await;
            Ok(())
        });
    }

    /// Starts one that may fail.
    pub fn spawn_fallible(&mut self, part: impl Future<Output = anyhow::Result<()>> + Send + 'static) {
        self.0.spawn(part);
    }

    /// Waits until one of them ends, and gives how; `None` if there is none left.
    pub async fn next_end(&mut self) -> Option<anyhow::Result<()>> {
        let fault = |error| Err(anyhow!("a task of the daemon ended by a fault of this program: {error}"));
        Some(self.0.join_next().await?.unwrap_or_else(fault))
    }
}

impl Tasks {
    /// Has all of them end, and waits for it.
    ///
    /// # Errors
    /// If some have not ended in time, as on a disk that hangs: whoever ends the process does not wait for them. Else the first
    /// that failed.
    pub async fn close(mut self) -> anyhow::Result<()> {
        self.cancel.cancel();
        let all = async {
            while self.buses.join_next().await.is_some() {}
            let mut closed = Ok(());
            while let Some(ended) = self.parts.next_end().await {
                match (&closed, ended) {
                    (Ok(()), ended) => closed = ended,
                    (Err(_), Err(error)) => tracing::error!("{error:#}"),
                    (Err(_), Ok(())) => {}
                }
            }
            closed
        };
        let seconds = CLOSE_WITHIN.as_secs();
        let late =
            |_| Err(anyhow!("some parts did not close in time, within {seconds} s: the store is as after a kill"));
        tokio::time::timeout(CLOSE_WITHIN, all).await.unwrap_or_else(late)
    }
}
