//! The tasks of a daemon, and how they end.

use std::time::Duration;

use anyhow::anyhow;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// After the end was asked for, the tasks have this long to close.
const CLOSE_WITHIN: Duration = Duration::from_secs(5);

/// All tasks of a daemon, from the first that is started on: with one of them the store is closed, so that they are closed on
/// every way out, also where a start fails.
#[derive(Default)]
pub struct Tasks {
    /// Tells all of them to end.
    pub cancel: CancellationToken,
    /// Engine, service and whatever else is beside the buses. Where one of them ends, the others do.
    pub parts: JoinSet<anyhow::Result<()>>,
    /// One for each bus. One that cannot go on ends alone, which it has logged.
    pub buses: JoinSet<()>,
}

impl Tasks {
    /// Has all of them end, and waits for it.
    ///
    /// # Errors
    /// If some have not ended in time, as on a disk that hangs: the end of the process does not wait for them. Else the first
    /// that failed.
    pub async fn close(mut self) -> anyhow::Result<()> {
        self.cancel.cancel();
        let all = async {
            while self.buses.join_next().await.is_some() {}
            let mut closed = Ok(());
            while let Some(ended) = next_end(&mut self.parts).await {
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

/// Waits until one of the parts ends, and gives how; `None` if there is none left.
pub async fn next_end(parts: &mut JoinSet<anyhow::Result<()>>) -> Option<anyhow::Result<()>> {
    let fault = |error| Err(anyhow!("a task of the daemon ended by a fault of this program: {error}"));
    Some(parts.join_next().await?.unwrap_or_else(fault))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::on_a_thread;

    /// The service manager is told that it failed.
    #[tokio::test]
    async fn a_part_that_fails_or_panics_is_a_failure_of_the_daemon() {
        let mut parts = JoinSet::new();
        let failing = on_a_thread("a", async { Err::<(), _>(anyhow!("no more descriptors")) }).unwrap();
        parts.spawn(async { failing.await? });
        let failed = next_end(&mut parts).await.unwrap().unwrap_err();
        assert_eq!(format!("{failed:#}"), "no more descriptors");
        let panicking = on_a_thread("b", async { panic!("as meant") }).unwrap();
        parts.spawn(panicking);
        parts.spawn(async { panic!("as meant") });
        for _ in 0..2 {
            let panicked = next_end(&mut parts).await.unwrap().unwrap_err();
            assert!(format!("{panicked:#}").contains("ended by a fault of this program"), "{panicked:#}");
        }
        assert!(next_end(&mut parts).await.is_none());
    }
}
