//! ROS 2 as `rmw_zenoh` speaks it, since its 0.2.4 (jazzy). `ros2-client` 0.12.1 cannot: it knows the hash of none of the
//! types of `types.rs`, and a node of ROS hears no publisher whose key has another hash.

use std::time::SystemTime;

use ros2_client::dds::rustdds::serialization::{RepresentationIdentifier, to_writer_with_rep_id};
use serde::Serialize;
use taxel_proto::Timestamp;
use xxhash_rust::xxh3::xxh3_128;
use zenoh::Session;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};

use crate::config::RosSection;
use crate::link::tried;
use crate::ros::NODE;
use crate::ros::types::{RosType, TRIGGER_HASH, TriggerResponse};

/// Plain CDR, little-endian, no options. Alignment is counted from behind it.
const CDR_HEAD: [u8; 4] = [0, 1, 0, 0];
/// Bytes of what is attached to a message: a number from 1, the time in ns, the length of the id, the id of the sender.
const ATTACHED_BYTES: usize = 33;
/// Requests that may wait at a service, as ROS has it. Older ones give way: a full queue would hold up all of Zenoh.
const WAITING_MAX: usize = 10;

/// A type and its hash, as keys and tokens have them.
fn type_chunks(kind: &str, [package, name, hash]: [&str; 3]) -> String {
    format!("{package}::{kind}::dds_::{name}_/RIHS01_{hash}")
}

fn cdr(message: &impl Serialize) -> anyhow::Result<Vec<u8>> {
    let mut bytes = CDR_HEAD.to_vec();
    to_writer_with_rep_id(&mut bytes, message, RepresentationIdentifier::CDR_LE)?;
    Ok(bytes)
}

/// A node in a Zenoh session of its own. It is there for others as long as its token.
pub struct Node {
    session: Session,
    names: Names,
    endpoints: u32,
    _token: LivelinessToken,
}

/// Where a node's things lie.
struct Names {
    domain: u16,
    session: String,
    namespace: String,
}

impl Names {
    /// The token of the node itself (number 0, `NN`), or the beginning of those of its publishers and services.
    fn token(&self, number: u32, kind: &str) -> String {
        let Self { domain, session, namespace } = self;
        format!("@ros2_lv/{domain}/{session}/0/{number}/{kind}/%/{}/{NODE}", namespace.replace('/', "%"))
    }

    /// The key of a topic or service, and the token that announces it: reliable, volatile, the last so many.
    fn endpoint(&self, number: u32, kind: &str, name: &str, types: &str, depth: usize) -> (String, String) {
        let key = format!("{}{name}/{types}", self.domain);
        (key, format!("{}/{}/{types}/::,{depth}:,:,:,,", self.token(number, kind), name.replace('/', "%")))
    }
}

impl Node {
    /// Announces a node.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn announce(session: Session, ros: &RosSection) -> anyhow::Result<Self> {
        let names =
            Names { domain: ros.domain, session: session.zid().to_string(), namespace: ros.namespace().to_owned() };
        let token = tried("announcing the node", session.liveliness().declare_token(names.token(0, "NN")).await)?;
        Ok(Self { session, names, endpoints: 0, _token: token })
    }

    /// Announces a topic of the absolute name `name`.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn topic<T: RosType>(&mut self, name: &str, depth: usize) -> anyhow::Result<Topic> {
        self.endpoints += 1;
        let types = type_chunks("msg", T::NAME);
        let (key, token) = self.names.endpoint(self.endpoints, "MP", name, &types, depth);
        let gid = xxh3_128(token.as_bytes()).to_le_bytes();
        // Drop: a router that does not take what comes must not hold up anything here. Not express: each message would
        // need a batch of its own, of which there are two, so that a millisecond in which nobody sends loses one (12 of
        // 75,000 at 1 kHz, and none in batches). Nothing waits for a batch to fill.
        let publisher = self.session.declare_publisher(key).congestion_control(CongestionControl::Drop);
        let publisher = tried(name, publisher.priority(Priority::InteractiveHigh).await)?;
        let token = tried(name, self.session.liveliness().declare_token(token).await)?;
        Ok(Topic { publisher, gid, sequence: 0, _token: token })
    }

    /// Announces a service of the type `std_srvs/srv/Trigger`.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn trigger(&mut self, name: &str) -> anyhow::Result<Trigger> {
        self.endpoints += 1;
        let types = type_chunks("srv", ["std_srvs", "Trigger", TRIGGER_HASH]);
        let (key, token) = self.names.endpoint(self.endpoints, "SS", name, &types, WAITING_MAX);
        let queue = RingChannel::new(WAITING_MAX);
        let requests = tried(name, self.session.declare_queryable(key).with(queue).complete(true).await)?;
        let token = tried(name, self.session.liveliness().declare_token(token).await)?;
        Ok(Trigger { requests, _token: token })
    }
}

/// A topic.
pub struct Topic {
    publisher: Publisher<'static>,
    gid: [u8; 16],
    sequence: i64,
    _token: LivelinessToken,
}

impl Topic {
    /// Sends a message of the topic's type; waits for no reader.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn publish(&mut self, message: &impl RosType) -> anyhow::Result<()> {
        self.sequence += 1;
        let put = self.publisher.put(cdr(message)?).attachment(attached(self.sequence, now_ns(), &self.gid));
        tried("publishing", put.await)
    }
}

/// Nanoseconds since 1970.
fn now_ns() -> i64 {
    let now = Timestamp::from(SystemTime::now());
    now.seconds * 1_000_000_000 + i64::from(now.nanos)
}

/// What is attached to a message. ROS drops one that lacks it.
fn attached(sequence: i64, time_ns: i64, gid: &[u8]) -> Vec<u8> {
    let head = [sequence.to_le_bytes(), time_ns.to_le_bytes()].concat();
    [head.as_slice(), &[16], gid].concat()
}

/// A service of the type `std_srvs/srv/Trigger`.
pub struct Trigger {
    requests: Queryable<RingChannelHandler<Query>>,
    _token: LivelinessToken,
}

impl Trigger {
    /// The next request, with what is attached to it. What is no request of ROS is left unanswered, as ROS does.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn next(&self) -> anyhow::Result<(Query, Vec<u8>)> {
        loop {
            let query = tried("a service", self.requests.recv_async().await)?;
            let attached = query.attachment().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
            if attached.len() == ATTACHED_BYTES {
                return Ok((query, attached));
            }
            tracing::warn!("no request of ROS: {} bytes are attached, expected {ATTACHED_BYTES}", attached.len());
        }
    }
}

/// Answers a request, whose number and sender go back with the answer.
///
/// # Errors
/// If the session is closed.
pub async fn answer((query, mut attached): (Query, Vec<u8>), response: &TriggerResponse) -> anyhow::Result<()> {
    attached[8..16].copy_from_slice(&now_ns().to_le_bytes());
    let reply = query.reply(query.key_expr().clone(), cdr(response)?).attachment(attached);
    tried("answering", reply.await)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::types::{Header, Time, WrenchStamped};

    fn hexadecimal(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    #[test]
    fn messages_have_the_bytes_that_ros_gives_them() {
        let header = Header { stamp: Time { sec: 1_700_000_000, nanosec: 123_456_789 }, frame_id: "l_forearm".into() };
        let wrench = WrenchStamped { header, value: [[1.5, -2.0, 10.25], [0.0, 0.0, 0.125]] };
        let of_ros = "0001000000f1536515cd5b070a0000006c5f666f726561726d000000000000000000f83f00000000000000c00000000000802\
                      44000000000000000000000000000000000000000000000c03f";
        assert_eq!(hexadecimal(&cdr(&wrench).unwrap()), of_ros);
        let response = TriggerResponse { success: true, message: "tared".into() };
        assert_eq!(hexadecimal(&cdr(&response).unwrap()), "000100000100000006000000746172656400");
    }

    #[test]
    fn keys_tokens_and_ids_are_as_rmw_zenoh_makes_them() {
        let names = Names { domain: 7, session: "ab12".into(), namespace: "/skin".into() };
        assert_eq!(names.token(0, "NN"), "@ros2_lv/7/ab12/0/0/NN/%/%skin/taxel_bridge");
        let without = Names { namespace: "/".into(), ..names };
        assert_eq!(without.token(0, "NN"), "@ros2_lv/7/ab12/0/0/NN/%/%/taxel_bridge");
        let types = type_chunks("msg", WrenchStamped::NAME);
        let (key, token) = without.endpoint(3, "MP", "/skin/arm/wrench", &types, 1);
        let shared = "geometry_msgs::msg::dds_::WrenchStamped_/\
                      RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
        assert_eq!(key, format!("7/skin/arm/wrench/{shared}"));
        assert_eq!(token, format!("@ros2_lv/7/ab12/0/3/MP/%/%/taxel_bridge/%skin%arm%wrench/{shared}/::,1:,:,:,,"));
        let id = xxh3_128(b"@ros2_lv/0/1234567890abcdef1234567890abcdef/0/0/NN/%/%/taxeld").to_le_bytes();
        assert_eq!(hexadecimal(&id), "5740dabfe9fff14bb838a6884302e9b0");
        let attached = attached(1, 2, &id);
        assert_eq!((attached.len(), attached[0], attached[8], attached[16]), (ATTACHED_BYTES, 1, 2, 16));
    }
}
