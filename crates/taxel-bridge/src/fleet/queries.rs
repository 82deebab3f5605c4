//! What a robot is asked for: each key takes the request of one call of the service and replies with that call's answer.

use prost::Message;
use taxel_proto::v1::{ImportModelSetRequest, ListEventsRequest, ListModelSetsRequest, ListModelSetsResponse};
use zenoh::Session;
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::query::{Query, Queryable};

use crate::daemon::{Daemon, answered};
use crate::fleet::keys;
use crate::fleet::robot::protobuf;
use crate::link::tried;

/// Sets on a page; longer ones need a place at the daemon.
const PAGE: u32 = 100;
/// Questions that may wait at a key. Beyond that the oldest is given up: a full queue must not hold up Zenoh, which
/// receives everything else on the same thread.
const WAITING_MAX: usize = 8;
/// Largest request: a model set as text.
const REQUEST_BYTES_MAX: usize = 17 << 20;

/// Which model sets are in use. The request is not looked at: all fit into one answer.
///
/// # Errors
/// If the session is closed.
pub async fn models(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked::at(&session, keys::models(&robot), "taxel.v1.ListModelSetsResponse").await?;
    loop {
        let (query, _) = asked.next::<ListModelSetsRequest>().await?;
        asked.reply(&query, in_use(&daemon).await).await;
    }
}

/// Those in use, of all that the daemon has, in pages that need no place of their own there.
async fn in_use(daemon: &Daemon) -> Result<ListModelSetsResponse, String> {
    let (mut model_sets, mut page_token) = (Vec::new(), String::new());
    loop {
        let request = ListModelSetsRequest { page_size: PAGE, page_token, ..ListModelSetsRequest::default() };
        let page = answered(daemon.models().list_model_sets(request)).await?;
        model_sets.extend(page.model_sets.into_iter().filter(|set| set.active));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return Ok(ListModelSetsResponse { model_sets, ..ListModelSetsResponse::default() });
        }
    }
}

/// What happened lately.
///
/// # Errors
/// If the session is closed.
pub async fn events(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked::at(&session, keys::events(&robot), "taxel.v1.ListEventsResponse").await?;
    loop {
        let (query, request) = asked.next::<ListEventsRequest>().await?;
        asked.reply(&query, answered(daemon.skin().list_events(request)).await).await;
    }
}

/// Takes a model set into the daemon's store. It is not in use until an operator of this robot activates it: the way from
/// a fleet to a force leads through a person who stands at the robot.
///
/// # Errors
/// If the session is closed.
pub async fn import(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked::at(&session, keys::import(&robot), "taxel.v1.ImportModelSetResponse").await?;
    loop {
        let (query, request) = asked.next::<ImportModelSetRequest>().await?;
        let imported = answered(daemon.models().import_model_set(request)).await;
        match &imported {
            Ok(taken) => {
                tracing::info!(model_set = taken.model_set, "a model set came from the fleet; it is not in use")
            }
            Err(why) => tracing::warn!("a model set from the fleet was refused: {why}"),
        }
        asked.reply(&query, imported).await;
    }
}

/// A key at which one question after the other is answered.
struct Asked {
    key: String,
    /// Of what it replies with.
    schema: &'static str,
    queries: Queryable<RingChannelHandler<Query>>,
}

impl Asked {
    async fn at(session: &Session, key: String, schema: &'static str) -> anyhow::Result<Self> {
        let queue = RingChannel::new(WAITING_MAX);
        let queries = tried("a queryable", session.declare_queryable(key.clone()).with(queue).complete(true).await)?;
        Ok(Self { key, schema, queries })
    }

    /// The next question whose payload is a request; one without asks for the defaults.
    async fn next<Q: Message + Default>(&self) -> anyhow::Result<(Query, Q)> {
        loop {
            let query = tried("a query", self.queries.recv_async().await)?;
            match self.request(&query) {
                Ok(request) => return Ok((query, request)),
                Err(why) => self.reply(&query, Err::<Q, _>(why)).await,
            }
        }
    }

    fn request<Q: Message + Default>(&self, query: &Query) -> Result<Q, String> {
        // A router lets somebody ask at a key, and a pattern of keys reaches more than one.
        if query.key_expr().as_str() != self.key {
            return Err(format!("asked at {}, expected {} itself", query.key_expr(), self.key));
        }
        let Some(payload) = query.payload() else { return Ok(Q::default()) };
        if payload.len() > REQUEST_BYTES_MAX {
            return Err(format!("the payload has {} bytes, at most {REQUEST_BYTES_MAX} are taken", payload.len()));
        }
        Q::decode(&*payload.to_bytes()).map_err(|error| format!("the payload is not the request's message: {error}"))
    }

    async fn reply<A: Message>(&self, query: &Query, answer: Result<A, String>) {
        let sent = match answer {
            Ok(answer) => query.reply(self.key.clone(), answer.encode_to_vec()).encoding(protobuf(self.schema)).await,
            Err(why) => query.reply_err(why).await,
        };
        if let Err(error) = sent {
            tracing::warn!(self.key, "the answer did not go out: {error}");
        }
    }
}
