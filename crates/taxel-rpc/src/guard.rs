//! What a connection may cost: how many there are, how long one may be silent at first, and the cut at the end.
//!
//! tonic bounds the calls of a connection but not the connections; and one that never sends the HTTP/2 preface would
//! live for ever and hold the shutdown up.

use futures_util::stream::{self, Stream};
use std::future::Future;
use std::io::{self, ErrorKind};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, BufWriter, ReadBuf};
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Sleep;
use tokio_util::either::Either;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::transport::server::{Connected, TcpConnectInfo};

use crate::limits::Limits;

/// Length of the HTTP/2 client preface, RFC 9113 section 3.4.
const PREFACE_BYTES: usize = 24;

/// A failed accept mostly means that file descriptors ran out; it is tried again after this pause.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Frames gather here until HTTP/2 flushes. A sample of 230 taxels fits; what is larger passes by.
const WRITE_BUFFER_BYTES: usize = 8 << 10;

/// Where connections come from. The caller binds it, so that a taken address is reported at start.
#[derive(Debug)]
pub enum Listener {
    /// TCP; there is no authentication here, so bind it to the loopback interface.
    Tcp(TcpListener),
    /// A Unix socket, guarded by its file's mode.
    Unix(UnixListener),
}

impl Listener {
    async fn accept(&self) -> io::Result<Either<TcpStream, UnixStream>> {
        match self {
            Self::Tcp(listener) => {
                let (stream, _) = listener.accept().await?;
                stream.set_nodelay(true)?; // a force sample is small and must not wait for the next
                Ok(Either::Left(stream))
            }
            Self::Unix(listener) => listener.accept().await.map(|(stream, _)| Either::Right(stream)),
        }
    }
}

/// Accepts connections for ever; no error of one ends it. `cut` closes all of them.
pub(crate) fn accept(
    listener: Listener,
    limits: &Limits,
    cut: CancellationToken,
) -> impl Stream<Item = io::Result<Connection>> + use<> {
    let places = Arc::new(Semaphore::new(limits.connections));
    let (most, preface) = (limits.connections, limits.preface);
    stream::unfold(listener, move |listener| {
        let (places, cut) = (Arc::clone(&places), cut.clone());
        async move {
            loop {
                match listener.accept().await {
                    Ok(io) => match places.clone().try_acquire_owned() {
                        Ok(place) => return Some((Ok(Connection::new(io, preface, cut, place)), listener)),
                        Err(_) => tracing::warn!("connection refused: {most} are open, which is the limit"),
                    },
                    Err(error) => {
                        tracing::warn!(%error, "a connection was not accepted");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                }
            }
        }
    })
}

/// One connection under guard.
pub(crate) struct Connection {
    /// Buffered, so that a large frame's head and payload are one write.
    io: BufWriter<Either<TcpStream, UnixStream>>,
    /// Bytes of the preface still to come, and by when.
    preface: Option<(usize, Pin<Box<Sleep>>)>,
    cut: Pin<Box<WaitForCancellationFutureOwned>>,
    /// Free again when the connection is gone.
    _place: OwnedSemaphorePermit,
}

impl Connection {
    fn new(
        io: Either<TcpStream, UnixStream>,
        preface: Duration,
        cut: CancellationToken,
        place: OwnedSemaphorePermit,
    ) -> Self {
        let preface = Some((PREFACE_BYTES, Box::pin(tokio::time::sleep(preface))));
        let io = BufWriter::with_capacity(WRITE_BUFFER_BYTES, io);
        Self { io, preface, cut: Box::pin(cut.cancelled_owned()), _place: place }
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        if self.cut.as_mut().poll(cx).is_ready() {
            return Poll::Ready(Err(io::Error::new(ErrorKind::ConnectionAborted, "cut at shutdown")));
        }
        let before = buf.filled().len();
        let read = Pin::new(&mut self.io).poll_read(cx, buf);
        if let Some((missing, deadline)) = &mut self.preface {
            *missing = missing.saturating_sub(buf.filled().len() - before);
            if *missing == 0 {
                self.preface = None;
            } else if deadline.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Err(io::Error::new(ErrorKind::TimedOut, "no HTTP/2 preface within the limit")));
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
    /// are: the messages to all streams of a connection are one write.
    fn is_write_vectored(&self) -> bool {
        false
    }
}

impl Connected for Connection {
    /// Without addresses for a Unix socket.
    type ConnectInfo = TcpConnectInfo;

    fn connect_info(&self) -> TcpConnectInfo {
        match self.io.get_ref() {
            Either::Left(tcp) => tcp.connect_info(),
            Either::Right(_) => TcpConnectInfo { local_addr: None, remote_addr: None },
        }
    }
}
