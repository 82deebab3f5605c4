//! The tasks of a daemon, and how they end.

use std::time::Duration;

use anyhow::anyhow;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::bus::BusEnd;
use crate::parts::Parts;

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
