//! The body of an answer, whose call and place last until its last byte is out.

use std::mem;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};

use http_body::{Body, Frame, SizeHint};
use taxel_proto::refusal::complete;
use tonic::codegen::Bytes;

use crate::connections::{Call, Waiting};
use crate::shares;

/// A larger frame goes out in pieces of this size, so that a slow reader is seen to take something.
const PIECE_BYTES: usize = 16 << 10;

/// What an answer holds.
#[derive(Debug)]
struct Held {
    call: Option<Call>,
    _place: shares::Held,
}

/// A body under the eyes of the watch over connections.
#[derive(Debug)]
pub struct Answer<B> {
    body: B,
    /// What is left of its last frame.
    rest: Bytes,
    held: Arc<Held>,
}

/// Bytes of an answer: the peer has taken them when they are dropped.
struct Piece {
    bytes: Bytes,
    _waiting: Option<Waiting>,
    _held: Arc<Held>,
}

impl AsRef<[u8]> for Piece {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl<B> Answer<B> {
    /// The answer to this call.
    pub fn of(call: Call, body: B) -> Self {
        Self::new(body, Some(call), None)
    }

    pub(crate) fn new(body: B, call: Option<Call>, place: shares::Held) -> Self {
        Self { body, rest: Bytes::new(), held: Arc::new(Held { call, _place: place }) }
    }

    fn piece(&mut self, data: Bytes) -> Frame<Bytes> {
        self.rest = data;
        let bytes = self.rest.split_to(self.rest.len().min(PIECE_BYTES));
        let waiting = self.held.call.as_ref().map(Call::wait);
        Frame::data(Bytes::from_owner(Piece { bytes, _waiting: waiting, _held: Arc::clone(&self.held) }))
    }
}

impl<B: Body<Data = Bytes> + Unpin> Body for Answer<B> {
    type Data = Bytes;
    type Error = B::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, B::Error>>> {
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
