//! What goes out to ROS, and when: a force the moment it comes and only if it is one, taxels at their rate, the
//! diagnostics once a second and when something changes.

use std::time::Duration;

use taxel_proto::Timestamp;
use taxel_proto::v1::{GetSkinRequest, Skin, TaxelSample};
use tokio::sync::watch;
use tokio::time::Instant;

use crate::belief::{NoForce, believe, limit_of};
use crate::config::{PatchSection, RosSection};
use crate::daemon::{Daemon, words};
use crate::feed::{Feed, HealthFeed};
use crate::follow::Newest;
use crate::ros::diagnostics::{self, PatchView};
use crate::ros::keys::{KeepLast, name_of};
use crate::ros::messages;
use crate::ros::node::{RosNode, Topic, wall_ns};
use crate::ros::types::{DiagnosticArray, Header, JointState, PointCloud2, PointStamped, Time, WrenchStamped};

/// Where ROS expects diagnostics, in every namespace.
const DIAGNOSTICS: &str = "/diagnostics";
/// Diagnostics go out so often, and at once when a level changes.
const DIAGNOSTICS_EVERY: Duration = Duration::from_secs(1);
/// So often it is looked whether a level has changed.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Readers want the newest force and no queue of old ones.
const NEWEST: KeepLast = KeepLast(1);

/// A stamp that lies further back than this is no jitter: the wall clock was set.
const CLOCK_SET: i128 = 1_000_000_000;

/// The stamps of a topic, which never go back. The daemon works the wall-clock time of a frame out anew for each sample,
/// so that a sample may carry a stamp a little before that of the one which went out before it.
#[derive(Debug, Default)]
struct Stamps {
    newest_ns: Option<i128>,
}

impl Stamps {
    /// Whether a sample of this time may follow what went out; it counts as sent then.
    fn follows(&mut self, time: Option<&Timestamp>) -> bool {
        let Some(ns) = time.map(|time| i128::from(time.seconds) * 1_000_000_000 + i128::from(time.nanos)) else {
            return true;
        };
        if self.newest_ns.is_some_and(|newest| ns < newest && newest - ns < CLOCK_SET) {
            return false;
        }
        self.newest_ns = Some(ns);
        true
    }
}

/// The topics of a patch's force.
pub struct ForceTopics {
    wrench: Topic<WrenchStamped>,
    force: Topic<JointState>,
    centre: Topic<PointStamped>,
}

impl ForceTopics {
    /// Announces them.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn announce(node: &mut RosNode, ros: &RosSection, patch: &PatchSection) -> anyhow::Result<Self> {
        let name = |topic: &str| ros.absolute(&format!("{}/{topic}", name_of(&patch.name)));
        Ok(Self {
            wrench: node.topic(&name("wrench"), NEWEST).await?,
            force: node.topic(&name("force"), NEWEST).await?,
            centre: node.topic(&name("centre_of_pressure"), NEWEST).await?,
        })
    }

    /// Publishes each force once, for as long as the daemon is followed.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn publish(mut self, mut feed: Feed) -> anyhow::Result<()> {
        let frame = feed.section.frame().to_owned();
        let (mut last, mut stamps) = (0, Stamps::default());
        loop {
            feed.force.changed().await?;
            let newest = feed.force.borrow_and_update().received.clone();
            // A change may also be the end of the stream: a sample that went out already does not go out as a new one.
            let Some(received) = newest.filter(|received| received.number > last) else { continue };
            feed.counts.skip(received.number - last - 1);
            last = received.number;
            let sample = &received.sample;
            if believe(sample, received.waited(), limit_of(sample)).is_err() || !stamps.follows(sample.time.as_ref()) {
                feed.counts.withhold();
                continue;
            }
            if let Some(message) = messages::wrench(sample, &frame) {
                self.wrench.publish(&message).await?;
            }
            if let Some(message) = messages::force(sample, &frame) {
                self.force.publish(&message).await?;
            }
            if let Some(message) = messages::centre_of_pressure(sample, &frame) {
                self.centre.publish(&message).await?;
            }
            feed.counts.publish();
        }
    }
}

/// Publishes a patch's taxels as they come.
///
/// # Errors
/// If the session is closed.
pub async fn taxels(
    mut topic: Topic<PointCloud2>,
    section: PatchSection,
    daemon: Daemon,
    mut taxels: watch::Receiver<Newest<TaxelSample>>,
) -> anyhow::Result<()> {
    let (mut last, mut layout) = (0, None);
    loop {
        taxels.changed().await?;
        let (newest, lost) = {
            let newest = taxels.borrow_and_update();
            (newest.received.clone(), newest.lost.is_some())
        };
        if lost {
            layout = None; // the daemon that comes back may have another configuration
        }
        let Some(received) = newest.filter(|received| received.number > last) else { continue };
        last = received.number;
        if layout.is_none() {
            layout = skin(&daemon, &section.name).await;
        }
        let fits = layout.as_ref().filter(|skin| skin.taxels.len() == received.sample.taxels.len());
        let cloud = fits.and_then(|skin| messages::taxels(&received.sample, skin, section.frame(), received.waited()));
        if let Some(cloud) = cloud {
            topic.publish(&cloud).await?;
        }
    }
}

async fn skin(daemon: &Daemon, patch: &str) -> Option<Skin> {
    match daemon.skin().get_skin(GetSkinRequest { patch: patch.to_owned() }).await {
        Ok(skin) => Some(skin.into_inner()),
        Err(status) => {
            tracing::warn!(patch, "no layout of the taxels: {}", words(&status));
            None
        }
    }
}

/// Announces the topic of diagnostics.
///
/// # Errors
/// If the session is closed.
pub async fn diagnostics_topic(node: &mut RosNode) -> anyhow::Result<Topic<DiagnosticArray>> {
    node.topic(DIAGNOSTICS, KeepLast(10)).await
}

/// Publishes how everything is.
///
/// # Errors
/// If the session is closed.
pub async fn diagnostics(
    mut topic: Topic<DiagnosticArray>,
    robot: String,
    feeds: Vec<Feed>,
    health: HealthFeed,
) -> anyhow::Result<()> {
    let mut look = tokio::time::interval(LOOK_EVERY);
    look.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
    let mut sent: Option<(Instant, Vec<u8>)> = None;
    loop {
        look.tick().await;
        let mut status: Vec<_> = feeds.iter().map(|feed| of_patch(&robot, feed)).collect();
        status.extend(match &*health.borrow() {
            Ok(health) => diagnostics::daemon(&robot, Ok(health)),
            Err(why) => diagnostics::daemon(&robot, Err(why)),
        });
        let levels: Vec<u8> = status.iter().map(|status| status.level).collect();
        let due = sent.as_ref().is_none_or(|(at, before)| at.elapsed() >= DIAGNOSTICS_EVERY || *before != levels);
        if due {
            let ns = wall_ns();
            let stamp = Time {
                sec: i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX),
                nanosec: (ns % 1_000_000_000) as u32,
            };
            topic.publish(&DiagnosticArray { header: Header { stamp, frame_id: String::new() }, status }).await?;
            sent = Some((Instant::now(), levels));
        }
    }
}

fn of_patch(robot: &str, feed: &Feed) -> crate::ros::types::DiagnosticStatus {
    let newest = feed.force.borrow();
    let sample = newest.received.as_ref().map(|received| &received.sample);
    let belief = newest.received.as_ref().map_or(Err(NoForce::Nothing), |received| {
        believe(&received.sample, received.waited(), limit_of(&received.sample))
    });
    let [published, withheld, skipped] = feed.counts.all();
    let lost = newest.lost.as_deref();
    let view = PatchView { patch: &feed.section.name, lost, sample, belief, published, withheld, skipped };
    diagnostics::patch(robot, &view)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_never_go_back_unless_the_clock_was_set() {
        let mut stamps = Stamps::default();
        let mut follows = |seconds, nanos| stamps.follows(Some(&Timestamp { seconds, nanos }));
        assert!(follows(100, 500) && follows(100, 500) && follows(100, 600));
        assert!(!follows(100, 599), "a frame's time that was worked out again");
        assert!(follows(90, 0), "the clock was set back by ten seconds");
        assert!(follows(90, 1) && stamps.follows(None));
    }
}
