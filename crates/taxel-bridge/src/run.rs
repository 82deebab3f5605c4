//! Wires a bridge as its configuration says.

use taxel_proto::v1::TaxelSample;
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::config::{Config, FleetSection, RosSection, ZenohSection};
use crate::daemon::Daemon;
use crate::feed::{self, Feed, HealthFeed};
use crate::fleet::{queries, robot};
use crate::follow::{self, Newest};
use crate::link;
use crate::ros::keys::{Graph, KeepLast, name_of};
use crate::ros::node::RosNode;
use crate::ros::publish::{self, ForceTopics};
use crate::ros::tare;
use crate::signals::asked_to_end;

type Tasks = JoinSet<anyhow::Result<()>>;

/// Runs a bridge until it is ended.
///
/// # Errors
/// If the configuration cannot be used, or a Zenoh session is closed.
pub async fn run(config: Config) -> anyhow::Result<()> {
    let daemon = Daemon::new(&config.daemon)?;
    let mut tasks = Tasks::new();
    let feeds: Vec<Feed> =
        config.patches.iter().map(|section| feed::patch(section.clone(), &daemon, &mut tasks)).collect();
    let health = feed::health(&daemon, &mut tasks);
    let bridge = Bridge { robot: config.robot, zenoh: config.zenoh, daemon, feeds, health };
    tracing::info!(daemon = bridge.daemon.server(), "the bridge runs");
    // ROS and the fleet have a session each: their routers may be two, and one that is away does not hold up the other.
    let running = async {
        tokio::try_join!(bridge.ros(config.ros.as_ref()), bridge.fleet(config.fleet.as_ref()), first_end(tasks))
    };
    tokio::select! {
        ended = running => ended.map(|_| ()),
        asked = asked_to_end() => {
            asked?;
            tracing::info!("the bridge ends, as it was asked to");
            Ok(())
        }
    }
}

/// Waits for the first task to end, which none does without an error.
async fn first_end(mut tasks: Tasks) -> anyhow::Result<()> {
    match tasks.join_next().await {
        Some(ended) => ended?,
        None => Ok(()),
    }
}

struct Bridge {
    robot: String,
    zenoh: ZenohSection,
    daemon: Daemon,
    feeds: Vec<Feed>,
    health: HealthFeed,
}

impl Bridge {
    /// Announces and publishes the topics of ROS.
    async fn ros(&self, ros: Option<&RosSection>) -> anyhow::Result<()> {
        let Some(ros) = ros else { return Ok(()) };
        let (session, mut tasks) = (link::open(&self.zenoh).await?, Tasks::new());
        let graph = Graph { domain: ros.domain, type_hashes: ros.type_hashes };
        let mut node = RosNode::announce(session, graph, ros.namespace.clone(), ros.node.clone()).await?;
        for feed in &self.feeds {
            let topics = ForceTopics::announce(&mut node, ros, &feed.section).await?;
            tasks.spawn(topics.publish(feed.clone()));
            self.taxels(ros, feed, &mut node, &mut tasks).await?;
        }
        let topic = publish::diagnostics_topic(&mut node).await?;
        tasks.spawn(publish::diagnostics(topic, self.robot.clone(), self.feeds.clone(), self.health.clone()));
        if ros.tare {
            let names: Vec<_> = self.feeds.iter().map(|feed| feed.section.name.clone()).collect();
            let all = node.trigger(&ros.absolute("tare")).await?;
            tasks.spawn(tare::serve(all, self.daemon.clone(), names.clone()));
            for name in names {
                let one = node.trigger(&ros.absolute(&format!("{}/tare", name_of(&name)))).await?;
                tasks.spawn(tare::serve(one, self.daemon.clone(), vec![name]));
            }
        }
        first_end(tasks).await
    }

    async fn taxels(&self, ros: &RosSection, feed: &Feed, node: &mut RosNode, tasks: &mut Tasks) -> anyhow::Result<()> {
        let section = feed.section.clone();
        if section.taxels_hz == 0.0 {
            return Ok(());
        }
        let topic = node.topic(&ros.absolute(&format!("{}/taxels", name_of(&section.name))), KeepLast(1)).await?;
        let (sender, taxels) = watch::channel(Newest::<TaxelSample>::nothing());
        let following = follow::taxels(self.daemon.clone(), section.name.clone(), section.taxels_hz, sender);
        tasks.spawn(async move {
            following.await;
            Ok(())
        });
        tasks.spawn(publish::taxels(topic, section, self.daemon.clone(), taxels));
        Ok(())
    }

    /// Announces the robot and tells what it tells.
    async fn fleet(&self, fleet: Option<&FleetSection>) -> anyhow::Result<()> {
        let Some(fleet) = fleet else { return Ok(()) };
        let (session, mut tasks) = (link::open(fleet.zenoh.as_ref().unwrap_or(&self.zenoh)).await?, Tasks::new());
        let name = || self.robot.clone();
        for feed in &self.feeds {
            tasks.spawn(robot::force(session.clone(), name(), feed.clone(), fleet.rate_hz));
        }
        tasks.spawn(robot::health(session.clone(), name(), self.health.clone()));
        tasks.spawn(queries::models(session.clone(), name(), self.daemon.clone()));
        tasks.spawn(queries::events(session.clone(), name(), self.daemon.clone()));
        if fleet.imports {
            tasks.spawn(queries::import(session.clone(), name(), self.daemon.clone()));
        }
        let _alive = robot::announce(&session, &self.robot).await?;
        first_end(tasks).await
    }
}
