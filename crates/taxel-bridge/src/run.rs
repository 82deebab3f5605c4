//! Wires a bridge as its configuration says.

use tokio::task::JoinSet;

use crate::asked_to_end;
use crate::config::Config;
use crate::daemon::Daemon;
use crate::fleet::robot;
use crate::link;
use crate::ros::node::Node;
use crate::ros::publish::{self, ForceTopics};
use crate::ros::tare;
use crate::yarp::publish::{self as ports, Followed, Ports};

/// What a fleet is told in a second of each patch, if not otherwise configured.
const FLEET_HZ: f64 = 10.0;

type Tasks = JoinSet<anyhow::Result<()>>;

/// Runs a bridge until it is ended.
///
/// # Errors
/// If the configuration cannot be used, or a middleware ends.
pub async fn run(config: Config) -> anyhow::Result<()> {
    let daemon = Daemon::new(&config.daemon)?;
    let ports = config.yarp.as_ref().map(Ports::of).transpose()?;
    let bridge = Bridge { config, daemon, ports };
    tracing::info!(daemon = bridge.daemon.server(), "the bridge runs");
    // ROS and the fleet have a session each: their routers may be two, and one that is away does not hold up the other.
    let running = async { tokio::try_join!(bridge.ros(), bridge.fleet(), bridge.yarp()) };
    let ended = tokio::select! {
        ended = running => ended.map(drop),
        asked = asked_to_end() => asked.inspect(|()| tracing::info!("the bridge ends, as it was asked to")),
    };
    if let Some(ports) = &bridge.ports {
        ports.give_back().await;
    }
    ended
}

/// Waits for the first task to end, which none does without an error.
async fn first_end(mut tasks: Tasks) -> anyhow::Result<()> {
    match tasks.join_next().await {
        Some(ended) => ended?,
        None => Ok(()),
    }
}

struct Bridge {
    config: Config,
    daemon: Daemon,
    ports: Option<Ports>,
}

impl Bridge {
    /// Announces and publishes the topics of ROS.
    async fn ros(&self) -> anyhow::Result<()> {
        let Some(ros) = &self.config.ros else { return Ok(()) };
        let mut tasks = Tasks::new();
        let (robot, patches) = (&self.config.robot, &self.config.patches);
        let mut node = Node::announce(ros, &self.config.zenoh).await?;
        let mut followed = Vec::new();
        for patch in patches {
            let topics = ForceTopics::announce(&mut node, ros, patch).await?;
            let forces = self.daemon.forces(&patch.name, patch.rate_hz);
            tasks.spawn(topics.publish(patch.clone(), forces.clone()));
            followed.push((patch.name.clone(), forces));
            if let Some(rate_hz) = patch.taxels_hz {
                let topic = node.topic(&ros.of_patch(&patch.name, "taxels"), publish::NEWEST).await?;
                let taxels = self.daemon.taxels(&patch.name, rate_hz);
                tasks.spawn(publish::taxels(topic, patch.clone(), taxels));
            }
        }
        let topic = node.topic(publish::DIAGNOSTICS, 10).await?;
        tasks.spawn(publish::diagnostics(topic, robot.clone(), followed, self.daemon.clone()));
        if ros.tare {
            let names: Vec<_> = patches.iter().map(|patch| patch.name.clone()).collect();
            let all = node.trigger(&ros.absolute("tare")).await?;
            tasks.spawn(tare::serve(all, self.daemon.clone(), names.clone()));
            for name in names {
                let one = node.trigger(&ros.of_patch(&name, "tare")).await?;
                tasks.spawn(tare::serve(one, self.daemon.clone(), vec![name]));
            }
        }
        first_end(tasks).await
    }

    /// Writes the ports of YARP.
    async fn yarp(&self) -> anyhow::Result<()> {
        let (Some(yarp), Some(ports)) = (&self.config.yarp, &self.ports) else { return Ok(()) };
        let mut tasks = Tasks::new();
        for patch in &self.config.patches {
            let port = |last| format!("/taxeld/{}/{last}", patch.name);
            let forces = self.daemon.forces(&patch.name, patch.rate_hz);
            tasks.spawn(ports::forces(ports.clone(), port("force:o"), forces));
            let taxels = self.daemon.taxels(&patch.name, ports::PRESSURES_HZ);
            tasks.spawn(ports::taxels(ports.clone(), port("pressure:o"), taxels));
        }
        let events = yarp.skin_events.as_deref().unwrap_or(ports::EVENTS);
        let followed = self.config.patches.iter().filter_map(|patch| Followed::new(patch, &self.daemon)).collect();
        tasks.spawn(ports::events(ports.clone(), events.to_owned(), self.daemon.clone(), followed));
        first_end(tasks).await
    }

    /// Tells what a robot tells its fleet.
    async fn fleet(&self) -> anyhow::Result<()> {
        let Some(fleet) = &self.config.fleet else { return Ok(()) };
        let mut tasks = Tasks::new();
        let session = link::open(fleet.zenoh.as_ref().unwrap_or(&self.config.zenoh)).await?;
        let robot = || self.config.robot.clone();
        for patch in &self.config.patches {
            let (name, forces) = (patch.name.clone(), self.daemon.forces(&patch.name, None));
            tasks.spawn(robot::force(session.clone(), robot(), name, forces, fleet.rate_hz.unwrap_or(FLEET_HZ)));
        }
        tasks.spawn(robot::health(session, robot(), self.daemon.clone()));
        first_end(tasks).await
    }
}
