//! What goes out to ROS, and when: a force the moment it comes and only if it is one, taxels at their rate, the
//! diagnostics once a second.

use std::time::{Duration, SystemTime};

use taxel_client::Forces;

use crate::config::{PatchSection, RosSection};
use crate::daemon::{Daemon, Taxels};
use crate::ros::diagnostics;
use crate::ros::messages;
use crate::ros::node::{Node, Topic};
use crate::ros::types::{DiagnosticArray, JointState, PointCloud2, PointStamped, WrenchStamped};
use crate::ticks;

/// Where ROS expects diagnostics, in every namespace.
pub const DIAGNOSTICS: &str = "/diagnostics";
/// Diagnostics go out so often.
const DIAGNOSTICS_EVERY: Duration = Duration::from_secs(1);
/// Readers want the newest force and no queue of old ones.
pub const NEWEST: usize = 1;

/// Seconds and nanoseconds since 1970.
type Stamp = (i64, i32);

/// Whether a frame's time lies before what went out. The daemon works it out anew for each sample, so it may be a little
/// earlier than that of the sample before. Two seconds are no jitter: the wall clock was set.
fn goes_back(newest: Stamp, time: Stamp) -> bool {
    time < newest && newest.0 - time.0 < 2
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
    /// If the middleware has ended.
    pub async fn announce(node: &mut Node, ros: &RosSection, patch: &PatchSection) -> anyhow::Result<Self> {
        let name = |topic| ros.of_patch(&patch.name, topic);
        Ok(Self {
            wrench: node.topic(&name("wrench"), NEWEST).await?,
            force: node.topic(&name("force"), NEWEST).await?,
            centre: node.topic(&name("centre_of_pressure"), NEWEST).await?,
        })
    }

    /// Publishes each force once, for as long as the daemon is followed.
    ///
    /// # Errors
    /// If the middleware has ended.
    pub async fn publish(mut self, section: PatchSection, mut forces: Forces) -> anyhow::Result<()> {
        let (mut last, mut newest) = (None, Stamp::default());
        loop {
            forces.changed().await;
            let Ok(force) = forces.force() else { continue };
            let sample = &force.sample;
            // A change may also be the end of the stream: a sample that went out already does not go out as a new one.
            let message = Some((sample.sequence, sample.age_s));
            let time = sample.time.map(|time| (time.seconds, time.nanos)).unwrap_or_default();
            if message != last && !goes_back(newest, time) {
                self.wrench.publish(messages::wrench(sample, section.frame())).await?;
                self.force.publish(messages::force(sample, section.frame())).await?;
                self.centre.publish(messages::centre_of_pressure(sample, section.frame())).await?;
                newest = time;
            }
            last = message;
        }
    }
}

/// Publishes a patch's taxels as they come.
///
/// # Errors
/// If the middleware has ended.
pub async fn taxels(mut topic: Topic<PointCloud2>, section: PatchSection, mut taxels: Taxels) -> anyhow::Result<()> {
    loop {
        if let Some((skin, sample, waited)) = taxels.next().await {
            topic.publish(messages::taxels(&sample, skin, section.frame(), waited)).await?;
        }
    }
}

/// Publishes how everything is.
///
/// # Errors
/// If the middleware has ended.
pub async fn diagnostics(
    mut topic: Topic<DiagnosticArray>,
    robot: String,
    patches: Vec<(String, Forces)>,
    daemon: Daemon,
) -> anyhow::Result<()> {
    let mut due = ticks(DIAGNOSTICS_EVERY);
    loop {
        due.tick().await;
        let mut status: Vec<_> =
            patches.iter().map(|(patch, forces)| diagnostics::patch(&robot, patch, &forces.force())).collect();
        status.push(diagnostics::daemon(&robot, daemon.health().await.as_ref()));
        let header = messages::header(Some(&SystemTime::now().into()), "").unwrap_or_default();
        topic.publish(Some(DiagnosticArray { header, value: status })).await?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_never_go_back_unless_the_clock_was_set() {
        assert!(!goes_back((100, 500), (100, 500)) && !goes_back((100, 500), (100, 600)));
        assert!(goes_back((100, 600), (100, 599)) && goes_back((100, 0), (99, 999_999_999)), "worked out again");
        assert!(!goes_back((100, 500), (90, 0)), "the clock was set back by ten seconds");
    }
}
