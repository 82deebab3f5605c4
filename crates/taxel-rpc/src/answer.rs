//! The body of an answer, whose call and place last until its last byte is on its way.

use std::mem;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use http_body::{Body, Frame, SizeHint};
use taxel_proto::refusal::complete;
use tonic::codegen::Bytes;

use crate::connections::Call;
use crate::shares::Held;

/// A larger frame goes out in pieces of this size, so that a slow reader is seen to take something.
const PIECE_BYTES: usize = 16 << 10;

/// A body under the eyes of the watch over connections. hyper asks it for more while the peer has room for that: it is the
/// peer's turn from when hyper has something, or has not asked yet, until hyper asks again.
#[derive(Debug)]
pub struct Answer<B> {
    body: B,
    /// What is left of its last frame.
    rest: Bytes,
    call: Option<Call>,
    _place: Held,
}

impl<B> Answer<B> {
    /// The answer to this call.
    pub fn of(call: Call, body: B) -> Self {
        Self::new(body, Some(call), None)
    }

    pub(crate) fn new(body: B, call: Option<Call>, place: Held) -> Self {
        let mut answer = Self { body, rest: Bytes::new(), call, _place: place };
        answer.wait_for_peer(true);
        answer
    }

    fn wait_for_peer(&mut self, waits: bool) {
        if let Some(call) = &mut self.call {
            call.waits(waits);
        }
    }

    fn piece(&mut self, data: Bytes) -> Frame<Bytes> {
        self.rest = data;
        self.wait_for_peer(true);
        Frame::data(self.rest.split_to(self.rest.len().min(PIECE_BYTES)))
    }
}

impl<B: Body<Data = Bytes> + Unpin> Body for Answer<B> {
    type Data = Bytes;
    type Error = B::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, B::Error>>> {
        self.wait_for_peer(false);
        if !self.rest.is_empty() {
            let rest = mem::take(&mut self.rest);
            return Poll::Ready(Some(Ok(self.piece(rest))));
        }
        let frame = ready!(Pin::new(&mut self.body).poll_frame(cx));
        Poll::Ready(frame.map(|frame| {
            Ok(match frame?.into_data() {
                Ok(data) => self.piece(data),
                Err(mut frame) => {
                    frame.trailers_mut().map(complete);
                    frame
                }
            })
        }))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let hint = self.body.size_hint();
        match hint.exact() {
            Some(bytes) => SizeHint::with_exact(bytes + self.rest.len() as u64),
            None => SizeHint::default(),
        }
    }
}
