//! Streams as server-sent events: <https://html.spec.whatwg.org/multipage/server-sent-events.html>.
//!
//! A message is made when there is room for it on the connection and not before, so a slow reader skips to the newest.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use futures_util::StreamExt;
use futures_util::stream::{self, BoxStream, SelectAll};
use http_body_util::{BodyExt, StreamBody};
use hyper::body::{Bytes, Frame};
use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::{Response, StatusCode};
use prost_reflect::DynamicMessage;
use taxel_proto::refusal::Refusal;
use tokio::sync::OwnedSemaphorePermit;
use tonic::Status;

use crate::answer::{Body, status_json};
use crate::call::Answer;

/// One of the streams of an answer.
pub(crate) struct Source {
    /// The call, `taxel.v1.Service/Method`.
    pub(crate) call: String,
    /// Its messages.
    pub(crate) answer: Answer,
    /// Free again when the stream is gone.
    pub(crate) place: OwnedSemaphorePermit,
}

/// What happens on one of the streams.
enum Happened {
    Message(Arc<str>, DynamicMessage),
    Ended(Arc<str>, Status),
}

/// An answer that carries all of `sources` until each has ended. The events of one stream have no name; of several,
/// each has the name of its call. The last event of a stream is `end`, with the status that it ended with.
pub(crate) fn events(sources: Vec<Source>, comment: Duration) -> Response<Body> {
    let named = sources.len() > 1;
    let all: SelectAll<BoxStream<'static, Happened>> = sources.into_iter().map(happenings).collect();
    let bytes = stream::unfold(all, move |mut all| async move {
        let bytes = match tokio::time::timeout(comment, all.next()).await {
            Err(_) => Bytes::from_static(b":\n\n"),
            Ok(None) => return None,
            Ok(Some(Happened::Message(call, message))) => event(named.then_some(&*call), &message),
            Ok(Some(Happened::Ended(call, status))) => end(&call, &status),
        };
        Some((Ok::<_, Infallible>(Frame::data(bytes)), all))
    });
    let mut response = Response::new(StreamBody::new(bytes).boxed_unsync());
    *response.status_mut() = StatusCode::OK;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/event-stream"));
    response
}

fn happenings(source: Source) -> BoxStream<'static, Happened> {
    let Source { call, answer, place } = source;
    let call: Arc<str> = call.into();
    let well = stream::once(async { Err(Status::ok("")) });
    let told = answer.messages().chain(well).scan(false, move |ended, item| {
        let _held = &place;
        let happened = match item {
            _ if *ended => None,
            Ok(message) => Some(Happened::Message(Arc::clone(&call), message)),
            Err(status) => Some(Happened::Ended(Arc::clone(&call), status)),
        };
        *ended = matches!(happened, Some(Happened::Ended(..)));
        std::future::ready(happened)
    });
    told.boxed()
}

/// One message. JSON has no line ends of its own here, so it is one line.
fn event(name: Option<&str>, message: &DynamicMessage) -> Bytes {
    let mut bytes = Vec::with_capacity(4096);
    if let Some(name) = name {
        bytes.extend_from_slice(format!("event: {name}\n").as_bytes());
    }
    bytes.extend_from_slice(b"data: ");
    if let Err(error) = serde_json::to_writer(&mut bytes, message) {
        return end(name.unwrap_or_default(), &Refusal::fault(format!("a message is no JSON: {error}")).into());
    }
    bytes.extend_from_slice(b"\n\n");
    bytes.into()
}

fn end(call: &str, status: &Status) -> Bytes {
    let mut told = status_json(status);
    if let Some(object) = told.as_object_mut() {
        object.insert("call".to_owned(), call.into());
    }
    format!("event: end\ndata: {told}\n\n").into()
}
