//! The parts of a daemon beside its buses, and how each ends.

use anyhow::anyhow;
use tokio::task::JoinSet;

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
