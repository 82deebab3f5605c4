//! One connection of a client, with what is known of its other end; and the body of an answer on it, whose call and place last
//! until its last byte is on its way.

use std::io;
use std::mem;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};

use http_body::{Body, Frame, SizeHint};
use taxel_proto::refusal::complete;
use tokio::io::{AsyncRead, AsyncWrite, BufWriter, ReadBuf};
use tonic::codegen::Bytes;
use tonic::transport::server::Connected;

use crate::access::origin::Origin;
use crate::connections::{Call, Seat};
use crate::limits::Place;

/// Length of the client's preface, RFC 9113 section 3.4.
const PREFACE_BYTES: usize = 24;

/// Frames gather here until HTTP/2 flushes. A sample of 230 taxels fits; what is larger passes by.
const WRITE_BUFFER_BYTES: usize = 8 << 10;

/// A larger frame goes out in pieces of this size, so that a slow reader is seen to take something.
const PIECE_BYTES: usize = 16 << 10;

/// A socket of any sort.
pub(crate) trait Io: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Io for T {}

/// Who makes a call, and over which connection if over one of ours. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Peer {
    pub(crate) origin: Arc<Origin>,
    pub(crate) seat: Option<Arc<Seat>>,
}

impl Peer {
    /// Somebody at this address, over no connection of ours.
    pub(crate) fn of_tcp(address: SocketAddr) -> Self {
        Self { origin: Arc::new(Origin::of_tcp(address)), seat: None }
    }
}

/// One connection.
pub(crate) struct Connection {
    /// Buffered, so that a large frame's head and payload are one write.
    io: BufWriter<Box<dyn Io>>,
    origin: Arc<Origin>,
    /// Bytes of the preface still to come.
    missing: usize,
    seat: Arc<Seat>,
}

impl Connection {
    pub(crate) fn new(io: Box<dyn Io>, origin: Origin, seat: Arc<Seat>) -> Self {
        let io = BufWriter::with_capacity(WRITE_BUFFER_BYTES, io);
        Self { io, origin: Arc::new(origin), missing: PREFACE_BYTES, seat }
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let read = Pin::new(&mut self.io).poll_read(cx, buf);
        if self.missing > 0 {
            self.missing = self.missing.saturating_sub(buf.filled().len() - before);
            if self.missing == 0 {
                self.seat.speaks_http2();
            }
        }
        read
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.io).poll_write(cx, buf)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(cx)
    }

    /// h2 gives a vectored writer each frame above 256 bytes by itself, and any other as many frames below 1 KiB as there
    /// are: what is due at the same tick on the streams of a connection is one write.
    fn is_write_vectored(&self) -> bool {
        false
    }
}

impl Connected for Connection {
    /// Every call finds it among its extensions.
    type ConnectInfo = Peer;

    fn connect_info(&self) -> Peer {
        Peer { origin: Arc::clone(&self.origin), seat: Some(Arc::clone(&self.seat)) }
    }
}

/// A body under the eyes of the watch over connections. hyper asks it for more while the peer has room for that: it is the
/// peer's turn from when hyper has something, or has not asked yet, until hyper asks again.
#[derive(Debug)]
pub struct Answer<B> {
    body: B,
    /// What is left of its last frame.
    rest: Bytes,
    call: Option<Call>,
    _place: Option<Arc<Place>>,
}

impl<B> Answer<B> {
    /// The answer to this call.
    pub fn of(call: Call, body: B) -> Self {
        Self::new(body, Some(call), None)
    }

    pub(crate) fn new(body: B, call: Option<Call>, place: Option<Arc<Place>>) -> Self {
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
