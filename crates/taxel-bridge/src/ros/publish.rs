//! What goes out to ROS, and when: a force the moment it comes and only if it is one, taxels at their rate, the
//! diagnostics once a second and when something changes.

use std::time::{Duration, SystemTime};

use taxel_client::Forces;
use taxel_proto::judge::on_the_way;
use taxel_proto::v1::{ForceSample, PatchRequest, StreamRequest};
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval};
use tonic::Status;

use crate::config::{PatchSection, RosSection};
use crate::daemon::{Daemon, HealthFeed, words};
use crate::ros::diagnostics;
use crate::ros::node::{Node, Topic};
use crate::ros::types::{
    DiagnosticArray, DiagnosticStatus, Header, JointState, PointCloud2, PointStamped, Time, WrenchStamped,
};
use crate::ros::{messages, name_of};
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
    /// If the middleware has ended.
    pub async fn publish(
        mut self,
        robot: String,
        section: PatchSection,
        mut forces: Forces,
        status: watch::Sender<DiagnosticStatus>,
    ) -> anyhow::Result<()> {
        let (mut last, mut newest, mut published, mut look) = (None, Stamp::default(), 0, looks());
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
            let time = sample.time.map(|time| (time.seconds, time.nanos)).unwrap_or_default();
            if message != last && !goes_back(newest, time) {
                self.send(sample, section.frame()).await?;
                (newest, published) = (time, published + 1);
            }
            last = message;
        }
    }

    async fn send(&mut self, sample: &ForceSample, frame: &str) -> anyhow::Result<()> {
        if let Some(message) = messages::wrench(sample, frame) {
            self.wrench.publish(message).await?;
        }
        if let Some(message) = messages::force(sample, frame) {
            self.force.publish(message).await?;
        }
        if let Some(message) = messages::centre_of_pressure(sample, frame) {
            self.centre.publish(message).await?;
        }
        Ok(())
    }
}

/// Publishes a patch's taxels as they come, over one stream after the other.
///
/// # Errors
/// If the middleware has ended.
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

/// Publishes the taxels of one stream, until the daemon ends it (`Err`) or the middleware has ended (`Ok`).
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
            && let Err(closed) = topic.publish(cloud).await
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
/// If the middleware has ended.
pub async fn diagnostics_topic(node: &mut Node) -> anyhow::Result<Topic<DiagnosticArray>> {
    node.topic(DIAGNOSTICS, 10).await
}

/// Publishes how everything is.
///
/// # Errors
/// If the middleware has ended.
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
            topic.publish(DiagnosticArray { header: Header { stamp, frame_id: String::new() }, status }).await?;
            sent = Some((Instant::now(), levels));
        }
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
