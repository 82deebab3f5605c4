//! The body of a request that is one message: it has to come on.

use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use http_body::{Frame, SizeHint};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tokio::time::Sleep;
use tonic::body::Body;
use tonic::codegen::Bytes;
use tonic::{Code, Status};

/// Ends with DEADLINE_EXCEEDED once nothing more of it has come for `pause`: a call holds places from its head on.
pub(crate) struct RequestBody {
    body: Body,
    pause: Duration,
    /// By when more has to come; absent while nothing is waited for.
    deadline: Option<Pin<Box<Sleep>>>,
}

impl RequestBody {
    pub(crate) fn new(body: Body, pause: Duration) -> Self {
        Self { body, pause, deadline: None }
    }
}

impl http_body::Body for RequestBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if let Poll::Ready(frame) = Pin::new(&mut self.body).poll_frame(cx) {
            self.deadline = None;
            return Poll::Ready(frame);
        }
        let pause = self.pause;
        let deadline = self.deadline.get_or_insert_with(|| Box::pin(tokio::time::sleep(pause)));
        ready!(deadline.as_mut().poll(cx));
        let why = format!("nothing more of the request came for {} s: send it whole", pause.as_secs_f64());
        Poll::Ready(Some(Err(Refusal::new(Code::DeadlineExceeded, ErrorReason::BodyRefused, why).into())))
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
