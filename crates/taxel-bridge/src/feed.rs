//! What comes from the daemon, ready for whoever publishes it: one feed a patch, and the health.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use taxel_proto::v1::{ForceSample, GetHealthRequest, Health};
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::config::PatchSection;
use crate::daemon::{Daemon, words};
use crate::follow::{self, Newest};

/// How often the daemon is asked for its health.
const HEALTH_EVERY: Duration = Duration::from_secs(1);
/// A daemon that does not answer by then does not run.
const HEALTH_WITHIN: Duration = Duration::from_secs(2);

/// What became of a patch's samples in ROS.
#[derive(Debug, Default)]
pub struct Counts {
    published: AtomicU64,
    withheld: AtomicU64,
    skipped: AtomicU64,
}

impl Counts {
    /// A force went out.
    pub fn publish(&self) {
        self.published.fetch_add(1, Ordering::Relaxed);
    }

    /// A sample was no force.
    pub fn withhold(&self) {
        self.withheld.fetch_add(1, Ordering::Relaxed);
    }

    /// So many samples were overtaken by newer ones.
    pub fn skip(&self, samples: u64) {
        self.skipped.fetch_add(samples, Ordering::Relaxed);
    }

    /// Published, withheld, skipped.
    pub fn all(&self) -> [u64; 3] {
        [&self.published, &self.withheld, &self.skipped].map(|count| count.load(Ordering::Relaxed))
    }
}

/// A patch.
#[derive(Clone, Debug)]
pub struct Feed {
    /// As configured.
    pub section: PatchSection,
    /// Its newest force.
    pub force: watch::Receiver<Newest<ForceSample>>,
    /// What became of its samples.
    pub counts: Arc<Counts>,
}

/// The daemon's health, or why it gives none.
pub type HealthFeed = watch::Receiver<Result<Health, String>>;

/// Follows a patch's force.
pub fn patch(section: PatchSection, daemon: &Daemon, tasks: &mut JoinSet<anyhow::Result<()>>) -> Feed {
    let (sender, force) = watch::channel(Newest::nothing());
    let following = follow::force(daemon.clone(), section.name.clone(), section.rate_hz, sender);
    tasks.spawn(async move {
        following.await;
        Ok(())
    });
    Feed { section, force, counts: Arc::default() }
}

/// Follows the daemon's health.
pub fn health(daemon: &Daemon, tasks: &mut JoinSet<anyhow::Result<()>>) -> HealthFeed {
    let (sender, health) = watch::channel(Err("not asked yet".to_owned()));
    let daemon = daemon.clone();
    tasks.spawn(async move {
        loop {
            let mut skin = daemon.skin();
            let answer = tokio::time::timeout(HEALTH_WITHIN, skin.get_health(GetHealthRequest {})).await;
            let told = match answer {
                Ok(Ok(answer)) => Ok(answer.into_inner()),
                Ok(Err(status)) => Err(words(&status)),
                Err(_) => Err(format!("no answer within {} s", HEALTH_WITHIN.as_secs())),
            };
            sender.send_modify(|health| *health = told);
            tokio::time::sleep(HEALTH_EVERY).await;
        }
    });
    health
}
