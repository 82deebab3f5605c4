//! A node of ROS 2 with its topics and services, in the middleware that the configuration names.

use anyhow::{Context as _, anyhow, bail};
use ros2_client::dds::{Context, ContextOptions, Node as DdsNode, Publisher, Server, ServiceMapping};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions, QosProfile, ServiceTypeName, WriteError};

use crate::config::{Middleware, RosSection, ZenohSection};
use crate::link;
use crate::ros::types::{RosType, TriggerResponse};
use crate::ros::{NODE, zenoh};

/// Requests that may wait at a service, as ROS has it.
const WAITING_MAX: usize = 10;

/// The node. It is there for others as long as this.
pub enum Node {
    /// For `rmw_fastrtps_cpp` and `rmw_cyclonedds_cpp`.
    Dds(Box<DdsNode>),
    /// For `rmw_zenoh_cpp`.
    Zenoh(zenoh::Node),
}

/// Reliable, so that subscribers of both kinds hear it; a reader that does not keep up loses messages and holds up nobody.
fn quality(depth: usize) -> QosProfile {
    QosProfile::publisher_default().reliability_reliable(WhenFull::Fail).history(History::KeepLast { depth })
}

impl Node {
    /// Announces a node; a router of Zenoh is waited for.
    ///
    /// # Errors
    /// If the configuration cannot be used, or there is no network.
    pub async fn announce(ros: &RosSection, router: &ZenohSection) -> anyhow::Result<Self> {
        if ros.middleware == Middleware::Zenoh {
            return Ok(Self::Zenoh(zenoh::Node::announce(link::open(router).await?, ros).await?));
        }
        let name = NodeName::new(ros.namespace(), NODE).map_err(|error| anyhow!("ros.namespace: {error}"))?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let context = Context::with_options(ContextOptions::new().domain_id(ros.domain)).context("opening DDS")?;
        Ok(Self::Dds(Box::new(context.new_node(name, options).context("announcing the node")?)))
    }

    /// Announces a topic of the absolute name `name`.
    ///
    /// # Errors
    /// If the middleware has ended.
    pub async fn topic<T: RosType>(&mut self, name: &str, depth: usize) -> anyhow::Result<Topic<T>> {
        let node = match self {
            Self::Zenoh(node) => return Ok(Topic::Zenoh(node.topic::<T>(name, depth).await?)),
            Self::Dds(node) => node,
        };
        let topic =
            node.create_topic(&Name::parse(name)?, MessageTypeName::new(T::NAME[0], T::NAME[1]), &quality(depth))?;
        Ok(Topic::Dds(node.create_publisher(&topic, None).context(name.to_owned())?))
    }

    /// Announces a service of the type `std_srvs/srv/Trigger`.
    ///
    /// # Errors
    /// If the middleware has ended.
    pub async fn trigger(&mut self, name: &str) -> anyhow::Result<Trigger> {
        let node = match self {
            Self::Zenoh(node) => return Ok(Trigger::Zenoh(node.trigger(name).await?)),
            Self::Dds(node) => node,
        };
        let (kind, quality) = (ServiceTypeName::new("std_srvs", "Trigger"), quality(WAITING_MAX));
        // As Fast DDS does it.
        let server = node.create_server(ServiceMapping::Enhanced, &Name::parse(name)?, &kind, quality.clone(), quality);
        Ok(Trigger::Dds(Box::new(server.context(name.to_owned())?)))
    }
}

/// A topic that messages of one type go out on.
pub enum Topic<T: RosType> {
    /// Over DDS.
    Dds(Publisher<T>),
    /// Over Zenoh.
    Zenoh(zenoh::Topic),
}

impl<T: RosType> Topic<T> {
    /// Sends a message, if there is one; waits for no reader.
    ///
    /// # Errors
    /// If the middleware has ended.
    pub async fn publish(&mut self, message: Option<T>) -> anyhow::Result<()> {
        let Some(message) = message else { return Ok(()) };
        match self {
            Self::Zenoh(topic) => topic.publish(&message).await,
            Self::Dds(publisher) => match publisher.publish(message) {
                Ok(()) | Err(WriteError::WouldBlock { .. }) => Ok(()),
                Err(error) => bail!("publishing: {error}"),
            },
        }
    }
}

/// A service of the type `std_srvs/srv/Trigger`.
pub enum Trigger {
    /// Over DDS.
    Dds(Box<Server<(), TriggerResponse>>),
    /// Over Zenoh.
    Zenoh(zenoh::Trigger),
}
