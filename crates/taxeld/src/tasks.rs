//! The tasks of a daemon, and how they end.

use std::time::Duration;

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
    pub parts: JoinSet<()>,
    /// One for each bus.
    pub buses: JoinSet<BusEnd>,
}

impl Tasks {
    /// Has all of them end, and waits for it.
    pub async fn close(mut self) {
        self.cancel.cancel();
        let all = async {
            while self.buses.join_next().await.is_some() {}
            while self.parts.join_next().await.is_some() {}
        };
        if tokio::time::timeout(CLOSE_WITHIN, all).await.is_err() {
            tracing::warn!(seconds = CLOSE_WITHIN.as_secs(), "some parts did not close in time");
        }
    }
}
