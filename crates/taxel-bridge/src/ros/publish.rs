//! What goes out to ROS, and when: a force the moment it comes and only if it is one, taxels at their rate, the
//! diagnostics once a second and when something changes.

use std::time::{Duration, SystemTime};

use taxel_client::Forces;
use taxel_proto::Timestamp;
use taxel_proto::judge::on_the_way;
use taxel_proto::v1::{ForceSample, PatchRequest, StreamRequest};
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval};
use tonic::Status;

use crate::config::{PatchSection, RosSection};
use crate::daemon::{Daemon, HealthFeed, words};
use crate::ros::diagnostics;
use crate::ros::keys::{KeepLast, name_of};
use crate::ros::messages;
use crate::ros::node::{RosNode, Topic};
use crate::ros::types::{
    DiagnosticArray, DiagnosticStatus, Header, JointState, PointCloud2, PointStamped, Time, WrenchStamped,
};
use crate::wall;

/// Where ROS expects diagnostics, in every namespace.
const DIAGNOSTICS: &str = "/diagnostics";
/// Diagnostics go out so often, and at once when a level changes.
const DIAGNOSTICS_EVERY: Duration = Duration::from_secs(1);
/// So often it is looked whether a level has changed.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Between two attempts to open a stream of taxels.
const AGAIN_AFTER: Duration = Duration::from_millis(500);
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

    /// Publishes each force once, for as long as the daemon is followed, and keeps the patch's diagnostics.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn publish(
        mut self,
        robot: String,
        section: PatchSection,
        mut forces: Forces,
        status: watch::Sender<DiagnosticStatus>,
    ) -> anyhow::Result<()> {
        let (mut last, mut stamps, mut published, mut look) = (None, Stamps::default(), 0, looks());
        loop {
            tokio::select! {
                () = forces.changed() => {}
                _ = look.tick() => {
                    status.send_replace(diagnostics::patch(&robot, &section.name, &forces.force(), published));
                    continue;
                }
            }
            let Ok(force) = forces.force() else { continue };
            let sample = &force.sample;
            // A change may also be the end of the stream: a sample that went out already does not go out as a new one.
            let message = Some((sample.sequence, sample.age_s));
            if message != last && stamps.follows(sample.time.as_ref()) {
                self.send(sample, section.frame()).await?;
                published += 1;
            }
            last = message;
        }
    }

    async fn send(&mut self, sample: &ForceSample, frame: &str) -> anyhow::Result<()> {
        if let Some(message) = messages::wrench(sample, frame) {
            self.wrench.publish(&message).await?;
        }
        if let Some(message) = messages::force(sample, frame) {
            self.force.publish(&message).await?;
        }
        if let Some(message) = messages::centre_of_pressure(sample, frame) {
            self.centre.publish(&message).await?;
        }
        Ok(())
    }
}

/// Publishes a patch's taxels as they come, over one stream after the other.
///
/// # Errors
/// If the session is closed.
pub async fn taxels(mut topic: Topic<PointCloud2>, section: PatchSection, daemon: Daemon) -> anyhow::Result<()> {
    let mut told = None;
    loop {
        let ended = match one_stream(&mut topic, &section, &daemon).await {
            Ok(closed) => return closed,
            Err(status) => words(&status),
        };
        if told.as_ref() != Some(&ended) {
            tracing::warn!(patch = section.name, "no taxels from the daemon: {ended}");
            told = Some(ended);
        }
        tokio::time::sleep(AGAIN_AFTER).await;
    }
}

/// Publishes the taxels of one stream, until the daemon ends it (`Err`) or the session is closed (`Ok`).
async fn one_stream(
    topic: &mut Topic<PointCloud2>,
    section: &PatchSection,
    daemon: &Daemon,
) -> Result<anyhow::Result<()>, Status> {
    let patch = section.name.clone();
    // A daemon that comes back may have another configuration.
    let skin = daemon.skin().get_skin(PatchRequest { patch: patch.clone() }).await?.into_inner();
    let request = StreamRequest { patch, rate_hz: Some(section.taxels_hz) };
    let mut stream = daemon.skin().stream_taxels(request).await?.into_inner();
    while let Some(sample) = stream.message().await? {
        if sample.taxels.len() != skin.taxels.len() {
            return Err(Status::aborted("the patch has another number of taxels now"));
        }
        let waited = on_the_way(sample.sent.as_ref(), SystemTime::now());
        if let Some(cloud) = messages::taxels(&sample, &skin, section.frame(), waited)
            && let Err(closed) = topic.publish(&cloud).await
        {
            return Ok(Err(closed));
        }
    }
    Err(Status::unavailable("the daemon ended the stream"))
}

/// When it is looked whether a level has changed.
fn looks() -> Interval {
    let mut look = interval(LOOK_EVERY);
    look.set_missed_tick_behavior(MissedTickBehavior::Skip);
    look
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
    patches: Vec<watch::Receiver<DiagnosticStatus>>,
    health: HealthFeed,
) -> anyhow::Result<()> {
    let (mut look, mut sent) = (looks(), None::<(Instant, Vec<u8>)>);
    loop {
        look.tick().await;
        let mut status: Vec<_> = patches.iter().map(|patch| patch.borrow().clone()).collect();
        status.extend(match &*health.borrow() {
            Ok(health) => diagnostics::daemon(&robot, Ok(health)),
            Err(why) => diagnostics::daemon(&robot, Err(why)),
        });
        let levels: Vec<u8> = status.iter().map(|status| status.level).collect();
        let due = sent.as_ref().is_none_or(|(at, before)| at.elapsed() >= DIAGNOSTICS_EVERY || *before != levels);
        if due {
            let ns = wall::now_ns();
            let stamp = Time {
                sec: i32::try_from(ns / 1_000_000_000).unwrap_or(i32::MAX),
                nanosec: (ns % 1_000_000_000) as u32,
            };
            topic.publish(&DiagnosticArray { header: Header { stamp, frame_id: String::new() }, status }).await?;
            sent = Some((Instant::now(), levels));
        }
    }
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
