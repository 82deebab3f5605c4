//! The body of a request that is one message, which has to come on.

use std::pin::Pin;
use std::task::{Context, Poll, ready};

use http_body::{Frame, SizeHint};
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::Bytes;

use crate::connections::Waiting;

/// Dropped by tonic once the message is there. Until then the watch over connections waits for the peer.
pub(crate) struct RequestBody {
    body: Body,
    waiting: Waiting,
}

impl RequestBody {
    pub(crate) const fn new(body: Body, waiting: Waiting) -> Self {
        Self { body, waiting }
    }
}

impl http_body::Body for RequestBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(cx));
        self.waiting.renew();
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
