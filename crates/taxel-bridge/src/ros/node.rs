//! A node of ROS 2 in a Zenoh session: topics and services, with the tokens that announce them.

use std::marker::PhantomData;
use std::time::{SystemTime, UNIX_EPOCH};

use zenoh::Session;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;

use crate::link::tried;
use crate::ros::attachment::{Attachment, Gid, gid};
use crate::ros::cdr;
use crate::ros::keys::{EndpointKind, Graph, KeepLast, Node};
use crate::ros::types::{RosType, TriggerResponse};

/// An empty request, as ROS sends it: the head of CDR and a byte that stands for no field.
const EMPTY_REQUEST_BYTES_MAX: usize = 8;

/// Nanoseconds since 1970.
pub fn wall_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The node. Its tokens go when it goes.
pub struct RosNode {
    session: Session,
    node: Node,
    endpoints: u32,
    _token: LivelinessToken,
}

impl RosNode {
    /// Announces a node.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn announce(session: Session, graph: Graph, namespace: String, name: String) -> anyhow::Result<Self> {
        let node = Node { graph, session: session.zid().to_string(), namespace, name };
        let token = tried("announcing the node", session.liveliness().declare_token(node.token()).await)?;
        Ok(Self { session, node, endpoints: 0, _token: token })
    }

    fn endpoint<T: RosType>(&mut self, kind: EndpointKind, name: &str, keeps: KeepLast) -> (String, String) {
        self.endpoints += 1;
        let key = self.node.graph.key::<T>(name);
        (key, self.node.endpoint_token::<T>(self.endpoints, kind, name, keeps))
    }

    /// Announces a topic of the absolute name `name`.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn topic<T: RosType>(&mut self, name: &str, keeps: KeepLast) -> anyhow::Result<Topic<T>> {
        let (key, token) = self.endpoint::<T>(EndpointKind::Publisher, name, keeps);
        let gid = gid(&token);
        // Drop: a router that does not take what comes must not hold up anything here. Not express: each message would
        // need a batch of its own, of which there are two, so that a millisecond in which nobody sends loses one (12 of
        // 75,000 at 1 kHz, and none in batches). Nothing waits for a batch to fill.
        let publisher = self.session.declare_publisher(key).congestion_control(CongestionControl::Drop);
        let publisher = tried(name, publisher.priority(Priority::InteractiveHigh).await)?;
        let token = tried(name, self.session.liveliness().declare_token(token).await)?;
        Ok(Topic { publisher, gid, sequence: 0, _token: token, _type: PhantomData })
    }

    /// Announces a service of the type `std_srvs/srv/Trigger`.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn trigger(&mut self, name: &str) -> anyhow::Result<Trigger> {
        let (key, token) = self.endpoint::<TriggerResponse>(EndpointKind::Service, name, KeepLast(10));
        let requests = tried(name, self.session.declare_queryable(key).complete(true).await)?;
        let token = tried(name, self.session.liveliness().declare_token(token).await)?;
        Ok(Trigger { requests, name: name.to_owned(), _token: token })
    }
}

/// A topic that messages of one type go out on.
pub struct Topic<T> {
    publisher: Publisher<'static>,
    gid: Gid,
    sequence: i64,
    _token: LivelinessToken,
    _type: PhantomData<T>,
}

impl<T: RosType> Topic<T> {
    /// Sends a message; waits for no reader.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn publish(&mut self, message: &T) -> anyhow::Result<()> {
        let payload = cdr::encode(message)?;
        self.sequence += 1;
        let attachment = Attachment { sequence: self.sequence, time_ns: wall_ns(), gid: self.gid };
        let put = self.publisher.put(payload).attachment(attachment.encode().to_vec());
        tried("publishing", put.await)
    }
}

/// A service of the type `std_srvs/srv/Trigger`.
pub struct Trigger {
    requests: zenoh::query::Queryable<zenoh::handlers::FifoChannelHandler<Query>>,
    name: String,
    _token: LivelinessToken,
}

/// A request that waits for its answer.
pub struct TriggerRequest {
    query: Query,
    attachment: Attachment,
}

impl Trigger {
    /// The next request. What is no request of ROS is told in the log and left unanswered, as ROS does.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn next(&self) -> anyhow::Result<TriggerRequest> {
        loop {
            let query = tried(&self.name, self.requests.recv_async().await)?;
            let bytes = query.attachment().map(|bytes| bytes.to_bytes().into_owned()).unwrap_or_default();
            let length = query.payload().map_or(0, zenoh::bytes::ZBytes::len);
            match Attachment::decode(&bytes) {
                Ok(attachment) if length <= EMPTY_REQUEST_BYTES_MAX => return Ok(TriggerRequest { query, attachment }),
                Ok(_) => tracing::warn!(service = self.name, "a request of {length} bytes, expected an empty one"),
                Err(error) => tracing::warn!(service = self.name, "no request of ROS: {error}"),
            }
        }
    }
}

impl TriggerRequest {
    /// Answers it.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn answer(self, response: &TriggerResponse) -> anyhow::Result<()> {
        let attachment = Attachment { time_ns: wall_ns(), ..self.attachment };
        let reply = self.query.reply(self.query.key_expr().clone(), cdr::encode(response)?);
        tried("answering", reply.attachment(attachment.encode().to_vec()).await)
    }
}
