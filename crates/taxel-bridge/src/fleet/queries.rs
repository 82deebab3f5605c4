//! What a robot is asked for: each key takes the request of one call of the service and replies with that call's answer.

use std::time::Duration;

use prost::Message;
use taxel_proto::v1::{
    GetCertificateRequest, ImportModelSetRequest, ListEventsRequest, ListModelSetsRequest, ListModelSetsResponse,
};
use tonic::{Response, Status};
use zenoh::Session;
use zenoh::query::Query;

use crate::daemon::{Daemon, words};
use crate::fleet::keys;
use crate::fleet::robot::protobuf;
use crate::link::tried;

/// Most model sets that a daemon has; all fit on one page.
const SETS_MAX: u32 = 1000;
/// A daemon that has not answered by then does not, and the next question has its turn.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// A key, and the schema of what it replies with.
struct Asked {
    key: String,
    schema: &'static str,
}

/// Which model sets are in use. The request is not looked at: all fit into one answer.
///
/// # Errors
/// If the session is closed.
pub async fn models(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked { key: keys::models(&robot), schema: "taxel.v1.ListModelSetsResponse" };
    serve(&session, &asked, async |_: ListModelSetsRequest| {
        let all = ListModelSetsRequest { page_size: SETS_MAX, ..ListModelSetsRequest::default() };
        let sets = daemon.models().list_model_sets(all).await?.into_inner();
        let model_sets = sets.model_sets.into_iter().filter(|set| set.active).collect();
        Ok(ListModelSetsResponse { model_sets, ..ListModelSetsResponse::default() })
    })
    .await
}

/// What happened lately.
///
/// # Errors
/// If the session is closed.
pub async fn events(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked { key: keys::events(&robot), schema: "taxel.v1.ListEventsResponse" };
    let call = async |request: ListEventsRequest| daemon.skin().list_events(request).await.map(Response::into_inner);
    serve(&session, &asked, call).await
}

/// The calibration certificate of a model set.
///
/// # Errors
/// If the session is closed.
pub async fn certificate(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked { key: keys::certificate(&robot), schema: "taxel.v1.Certificate" };
    let call =
        async |request: GetCertificateRequest| daemon.models().get_certificate(request).await.map(Response::into_inner);
    serve(&session, &asked, call).await
}

/// Takes a model set into the daemon's store. It is not in use until an operator of this robot activates it: the way from
/// a fleet to a force leads through a person who stands at the robot.
///
/// # Errors
/// If the session is closed.
pub async fn import(session: Session, robot: String, daemon: Daemon) -> anyhow::Result<()> {
    let asked = Asked { key: keys::import(&robot), schema: "taxel.v1.ImportModelSetResponse" };
    serve(&session, &asked, async |request: ImportModelSetRequest| {
        let imported = daemon.models().import_model_set(request).await.map(Response::into_inner);
        match &imported {
            Ok(taken) => {
                tracing::info!(model_set = taken.model_set, "a model set came from the fleet; it is not in use")
            }
            Err(status) => tracing::warn!("a model set from the fleet was refused: {}", words(status)),
        }
        imported
    })
    .await
}

/// Answers one question after the other, for ever.
async fn serve<Q, A>(session: &Session, asked: &Asked, call: impl AsyncFn(Q) -> Result<A, Status>) -> anyhow::Result<()>
where
    Q: Message + Default,
    A: Message,
{
    let key = &asked.key;
    let queries = tried("a queryable", session.declare_queryable(key.clone()).complete(true).await)?;
    loop {
        let query = tried("a query", queries.recv_async().await)?;
        let replied = match answer(&query, &call).await {
            Ok(bytes) => query.reply(key.clone(), bytes).encoding(protobuf(asked.schema)).await,
            Err(why) => query.reply_err(why).await,
        };
        if let Err(error) = replied {
            tracing::warn!(key, "the answer did not go out: {error}");
        }
    }
}

/// The answer's bytes, or why there is none. A question without a payload asks for the defaults.
async fn answer<Q, A>(query: &Query, call: &impl AsyncFn(Q) -> Result<A, Status>) -> Result<Vec<u8>, String>
where
    Q: Message + Default,
    A: Message,
{
    let bytes = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
    let request = Q::decode(&*bytes).map_err(|error| format!("the payload is not the request's message: {error}"))?;
    match tokio::time::timeout(ANSWER_WITHIN, call(request)).await {
        Ok(Ok(answer)) => Ok(answer.encode_to_vec()),
        Ok(Err(status)) => Err(words(&status)),
        Err(_) => Err(format!("the daemon has not answered within {} s", ANSWER_WITHIN.as_secs())),
    }
}
