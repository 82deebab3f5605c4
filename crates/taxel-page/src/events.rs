//! Streams as server-sent events: <https://html.spec.whatwg.org/multipage/server-sent-events.html>.
//!
//! A message is made when there is room for it on the connection and not before, so a slow reader skips to the newest.

use std::convert::Infallible;
use std::time::Duration;

use axum::response::sse::{Event, KeepAlive};
use axum::response::{IntoResponse, Response, Sse};
use futures_util::stream::{self, BoxStream, SelectAll, StreamExt};
use prost_reflect::DynamicMessage;
use taxel_proto::refusal::Refusal;
use tokio::sync::OwnedSemaphorePermit;
use tonic::{Status, Streaming};

use crate::answer::status_json;

/// One of the streams of an answer.
pub(crate) struct Source {
    /// The call, `taxel.v1.Service/Method`.
    pub(crate) call: String,
    /// Its messages.
    pub(crate) messages: Streaming<DynamicMessage>,
    /// Free again when the stream is gone.
    pub(crate) _place: OwnedSemaphorePermit,
}

/// An answer that carries all of `sources` until each has ended. The events of one stream have no name; of several,
/// each has the name of its call. The last event of a stream is `end`, with the status that it ended with.
pub(crate) fn events(sources: Vec<Source>, comment: Duration) -> Response {
    let named = sources.len() > 1;
    let all: SelectAll<BoxStream<'static, Event>> = sources
        .into_iter()
        .map(|source| stream::unfold(Some(source), move |source| next(source, named)).boxed())
        .collect();
    Sse::new(all.map(Ok::<_, Infallible>)).keep_alive(KeepAlive::new().interval(comment)).into_response()
}

/// The next event of a stream, and the stream unless that was the last.
async fn next(source: Option<Source>, named: bool) -> Option<(Event, Option<Source>)> {
    let mut source = source?;
    let told = match source.messages.message().await {
        Ok(Some(message)) => serde_json::to_string(&message)
            .map_err(|error| Status::from(Refusal::fault(format!("a message is no JSON: {error}")))),
        Ok(None) => Err(Status::ok("")),
        Err(status) => Err(status),
    };
    Some(match told {
        Ok(json) => {
            let event = if named { Event::default().event(&source.call) } else { Event::default() };
            (event.data(json), Some(source))
        }
        Err(status) => {
            let mut told = status_json(&status);
            told["call"] = source.call.into();
            (Event::default().event("end").data(told.to_string()), None)
        }
    })
}
