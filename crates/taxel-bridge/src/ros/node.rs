//! A node of ROS 2 in a Zenoh session: topics and services, with the tokens that announce them.

use std::marker::PhantomData;

use zenoh::Session;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{Query, Queryable};

use crate::link::tried;
use crate::ros::attachment::{Attachment, Gid, gid};
use crate::ros::cdr;
use crate::ros::keys::{EndpointKind, Graph, KeepLast, Node};
use crate::ros::types::{RosType, TriggerResponse};
use crate::wall;

/// An empty request, as ROS sends it: the head of CDR and a byte that stands for no field.
const EMPTY_REQUEST_BYTES_MAX: usize = 8;
/// Requests that may wait at a service, the newest: what is asked for takes seconds, and whoever asked before has asked
/// again or is gone. A full queue must not hold up Zenoh, which receives everything else on the same thread.
const WAITING_MAX: usize = 1;

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

    /// Announces a service of the type `std_srvs/srv/Trigger`. While a request is served the newest further one waits;
    /// one that gives way to a newer ends without an answer.
    ///
    /// # Errors
    /// If the session is closed.
    pub async fn trigger(&mut self, name: &str) -> anyhow::Result<Trigger> {
        let keeps = KeepLast(WAITING_MAX as u32);
        let (key, token) = self.endpoint::<TriggerResponse>(EndpointKind::Service, name, keeps);
        let queue = RingChannel::new(WAITING_MAX);
        let requests = tried(name, self.session.declare_queryable(key).with(queue).complete(true).await)?;
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
        let attachment = Attachment { sequence: self.sequence, time_ns: wall::now_ns(), gid: self.gid };
        let put = self.publisher.put(payload).attachment(attachment.encode().to_vec());
        tried("publishing", put.await)
    }
}

/// A service of the type `std_srvs/srv/Trigger`.
pub struct Trigger {
    requests: Queryable<RingChannelHandler<Query>>,
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
        let attachment = Attachment { time_ns: wall::now_ns(), ..self.attachment };
        let reply = self.query.reply(self.query.key_expr().clone(), cdr::encode(response)?);
        tried("answering", reply.attachment(attachment.encode().to_vec()).await)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use zenoh::handlers::FifoChannelHandler;
    use zenoh::query::Reply;

    type Replies = FifoChannelHandler<Reply>;

    /// Nothing that is waited for takes longer, on the slowest machine; an unanswered request ends well after it.
    const PATIENCE: Duration = Duration::from_secs(60);

    /// A session by itself.
    async fn alone() -> Session {
        let mut config = zenoh::Config::default();
        for (key, value) in [("scouting/multicast/enabled", "false"), ("listen/endpoints", "[]")] {
            config.insert_json5(key, value).unwrap();
        }
        zenoh::open(config).await.unwrap()
    }

    /// Asks as a client of ROS does, and waits for nothing.
    async fn ask(session: &Session, key: &str, sequence: i64) -> Replies {
        let attachment = Attachment { sequence, time_ns: 0, gid: gid("a client") };
        let get = session.get(key).payload(vec![0, 1, 0, 0, 0]).timeout(4 * PATIENCE);
        get.attachment(attachment.encode().to_vec()).await.unwrap()
    }

    async fn within<T>(what: &str, future: impl Future<Output = T>) -> T {
        tokio::time::timeout(PATIENCE, future).await.unwrap_or_else(|_| panic!("{what} does not come"))
    }

    /// Callers who come and go while a request is served: neither are their requests served one after the other, which
    /// takes minutes, nor does any of them wait at a full queue on a thread of Zenoh's.
    #[tokio::test(flavor = "multi_thread")]
    async fn while_a_request_is_served_only_the_newest_waits_and_the_others_end_without_an_answer() {
        let (session, graph) = (alone().await, Graph { domain: 7, type_hashes: true });
        let key = graph.key::<TriggerResponse>("/skin/tare");
        let mut node = RosNode::announce(session.clone(), graph, "/skin".into(), "bridge".into()).await.unwrap();
        let trigger = node.trigger("/skin/tare").await.unwrap();

        let first = ask(&session, &key, 1).await;
        let served = within("the first request", trigger.next()).await.unwrap();
        let mut passed_over = Vec::new();
        for sequence in 2..20 {
            passed_over.push(ask(&session, &key, sequence).await);
        }
        let newest = ask(&session, &key, 20).await;
        for replies in passed_over {
            let ended = within("the end of a request that is passed over", replies.recv_async()).await;
            assert!(ended.is_err(), "it was answered");
        }

        served.answer(&TriggerResponse { success: true, message: "the first".into() }).await.unwrap();
        let next = within("the next request", trigger.next()).await.unwrap();
        assert_eq!(next.attachment.sequence, 20);
        next.answer(&TriggerResponse { success: true, message: "the newest".into() }).await.unwrap();
        for (replies, word) in [(first, "the first"), (newest, "the newest")] {
            let reply = within(word, replies.recv_async()).await.unwrap();
            let payload = reply.result().unwrap().payload().to_bytes().into_owned();
            let said = String::from_utf8_lossy(&payload).into_owned();
            assert!(said.contains(word), "{said:?}");
        }
    }
}
