//! What a connection may cost: how many there are, how long one may be silent at first, and the cut at the end.
//!
//! tonic bounds the calls of a connection but not the connections; and one that never sends the HTTP/2 preface would
//! live for ever and hold the shutdown up.

use std::future::Future;
use std::io::{self, ErrorKind};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll};
use std::time::SystemTime;

use tokio::io::{AsyncRead, AsyncWrite, BufWriter, ReadBuf};
use tokio::time::Sleep;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::transport::server::Connected;

use crate::access::origin::Origin;
use crate::access::role::Role;
use crate::access::rules::Access;
use crate::limits::Limits;
use crate::paced::{PREFACE_BYTES, Paced};
use crate::refusals::Refusals;
use crate::shares::{NoPlace, Place, Shares, What};
use crate::stall::Stalling;
use crate::unproven::{Ticket, Unproven};

/// Frames gather here until HTTP/2 flushes. A sample of 230 taxels fits; what is larger passes by.
const WRITE_BUFFER_BYTES: usize = 8 << 10;

/// A socket of any sort.
pub(crate) trait Io: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Io for T {}

/// What all connections share.
#[derive(Clone)]
pub(crate) struct Guard {
    pub(crate) access: Access,
    pub(crate) shares: Arc<Shares>,
    pub(crate) refusals: Arc<Refusals>,
    pub(crate) unproven: Unproven,
    pub(crate) limits: Arc<Limits>,
    /// Closes all of them.
    pub(crate) cut: CancellationToken,
}

impl Guard {
    /// A connection from there has no place.
    pub(crate) fn tell(&self, origin: &Origin, why: NoPlace) {
        let key = origin.key();
        self.refusals.tell(("connection", &key), || {
            format!("a connection from {} was refused: {}", origin.place(), why.text(What::Connection, &key))
        });
    }

    /// Lets a connection in that has yet to prove that it speaks HTTP/2; `None` if there is no place for it anyway.
    pub(crate) fn let_in(&self, io: Box<dyn Io>, origin: Origin) -> Option<Connection> {
        let ticket = self.arrive(&origin)?;
        Some(self.connection(io, origin, ticket))
    }

    /// A place among those that have proven nothing yet, if there is one for it later.
    pub(crate) fn arrive(&self, origin: &Origin) -> Option<Ticket> {
        let room = self.shares.room(What::Connection, &origin.key(), self.is_operator(origin));
        room.inspect_err(|why| self.tell(origin, *why)).ok()?;
        Some(self.unproven.arrive(origin.key()))
    }

    pub(crate) fn connection(&self, io: Box<dyn Io>, origin: Origin, ticket: Ticket) -> Connection {
        let deadline = Box::pin(tokio::time::sleep(self.limits.preface));
        let expires = match &origin {
            Origin::Tls(_, certificate) => {
                let left = certificate.until.duration_since(SystemTime::now()).unwrap_or_default();
                Some(Box::pin(tokio::time::sleep(left)))
            }
            _ => None,
        };
        let ward = Arc::new(Ward::new(self.limits.untaken, self.cut.child_token()));
        Connection {
            cut: Box::pin(ward.cut.clone().cancelled_owned()),
            ward,
            io: BufWriter::with_capacity(
                WRITE_BUFFER_BYTES,
                Stalling::new(
                    Paced::new(io, self.limits.frames_of_no_call, self.limits.calls_per_connection),
                    self.limits.socket_stall,
                ),
            ),
            origin: Arc::new(origin),
            proof: Proof::Awaited { missing: PREFACE_BYTES, deadline, ticket },
            expires,
            guard: self.clone(),
        }
    }

    /// Whether whoever comes from there is an operator without showing a token.
    fn is_operator(&self, origin: &Origin) -> bool {
        self.access.rules().role(origin) >= Some(Role::Operator)
    }
}

/// Who makes a call, and by which connection if by one of ours. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Peer {
    pub(crate) origin: Arc<Origin>,
    pub(crate) ward: Option<Arc<Ward>>,
}

impl Peer {
    /// One more answer was given up that HTTP/2 still has some of.
    pub(crate) fn count_untaken(&self) {
        if let Some(ward) = &self.ward
            && ward.untaken.fetch_add(1, Ordering::Relaxed) >= ward.most
        {
            ward.cut.cancel();
        }
    }

    /// One of these is gone.
    pub(crate) fn count_taken(&self) {
        if let Some(ward) = &self.ward {
            ward.untaken.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// What the answers of a connection may do to it.
#[derive(Debug)]
pub(crate) struct Ward {
    /// Answers that were given up and are still somewhere.
    untaken: AtomicUsize,
    /// Beyond so many it is closed.
    most: usize,
    cut: CancellationToken,
}

impl Ward {
    const fn new(most: usize, cut: CancellationToken) -> Self {
        Self { untaken: AtomicUsize::new(0), most, cut }
    }
}

/// Whether a connection speaks HTTP/2.
enum Proof {
    Awaited {
        /// Bytes of the preface still to come.
        missing: usize,
        /// By when.
        deadline: Pin<Box<Sleep>>,
        ticket: Ticket,
    },
    /// The place is free again when the connection is gone.
    Given { _place: Place },
}

/// One connection under guard.
pub(crate) struct Connection {
    /// Buffered, so that a large frame's head and payload are one write.
    io: BufWriter<Stalling<Paced<Box<dyn Io>>>>,
    origin: Arc<Origin>,
    proof: Proof,
    ward: Arc<Ward>,
    cut: Pin<Box<WaitForCancellationFutureOwned>>,
    /// A connection does not outlive the certificate that it was opened with.
    expires: Option<Pin<Box<Sleep>>>,
    guard: Guard,
}

impl Connection {
    /// Whether it has to end, and why.
    fn poll_end(&mut self, cx: &mut Context<'_>) -> Poll<io::Error> {
        if self.cut.as_mut().poll(cx).is_ready() {
            return Poll::Ready(io::Error::new(
                ErrorKind::ConnectionAborted,
                "cut at shutdown, or for answers not taken",
            ));
        }
        if let Some(expires) = &mut self.expires
            && expires.as_mut().poll(cx).is_ready()
        {
            return Poll::Ready(io::Error::new(ErrorKind::PermissionDenied, "the client certificate has expired"));
        }
        if let Proof::Awaited { deadline, ticket, .. } = &mut self.proof {
            if ticket.poll_evicted(cx).is_ready() {
                return Poll::Ready(io::Error::new(ErrorKind::TimedOut, "no HTTP/2 preface, and others wait"));
            }
            if deadline.as_mut().poll(cx).is_ready() {
                return Poll::Ready(io::Error::new(ErrorKind::TimedOut, "no HTTP/2 preface within the limit"));
            }
        }
        Poll::Pending
    }

    /// What became of something that is to be sent: a connection that waits for its socket has to end all the same.
    fn sent<T>(&mut self, sent: Poll<io::Result<T>>, cx: &mut Context<'_>) -> Poll<io::Result<T>> {
        if sent.is_pending()
            && let Poll::Ready(error) = self.poll_end(cx)
        {
            return Poll::Ready(Err(error));
        }
        sent
    }

    /// So many bytes more came. With the last of the preface the connection takes its place.
    fn note(&mut self, bytes: usize) -> io::Result<()> {
        let Proof::Awaited { missing, .. } = &mut self.proof else { return Ok(()) };
        *missing = missing.saturating_sub(bytes);
        if *missing > 0 {
            return Ok(());
        }
        let guard = &self.guard;
        let taken = guard.shares.take(What::Connection, self.origin.key(), guard.is_operator(&self.origin));
        match taken {
            Ok(place) => {
                self.proof = Proof::Given { _place: place };
                Ok(())
            }
            Err(why) => {
                guard.tell(&self.origin, why);
                Err(io::Error::new(ErrorKind::ConnectionRefused, "there is no place for it"))
            }
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        let before = buf.filled().len();
        let read = Pin::new(&mut self.io).poll_read(cx, buf);
        if let Err(error) = self.note(buf.filled().len() - before) {
            return Poll::Ready(Err(error));
        }
        match self.poll_end(cx) {
            Poll::Ready(error) => Poll::Ready(Err(error)),
            Poll::Pending => read,
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.io).poll_write(cx, buf);
        self.sent(sent, cx)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let sent = Pin::new(&mut self.io).poll_flush(cx);
        self.sent(sent, cx)
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
        Peer { origin: Arc::clone(&self.origin), ward: Some(Arc::clone(&self.ward)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::rules::Rules;
    use crate::limits::Rate;
    use std::net::{Ipv4Addr, SocketAddr};
    use std::time::Duration;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    fn guard(limits: Limits) -> Guard {
        Guard {
            access: Access::new(Rules::open()),
            shares: Shares::new(&limits),
            refusals: Arc::default(),
            unproven: Unproven::new(limits.unproven),
            limits: Arc::new(limits),
            cut: CancellationToken::new(),
        }
    }

    /// A connection over a socket that holds this many bytes, and its other end.
    fn connection(guard: &Guard, holds: usize) -> (Connection, tokio::io::DuplexStream) {
        let (near, far) = tokio::io::duplex(holds);
        let origin = Origin::Loopback(SocketAddr::from((Ipv4Addr::LOCALHOST, 1)));
        (guard.let_in(Box::new(near), origin).unwrap(), far)
    }

    async fn send(connection: &mut Connection, bytes: usize) -> io::Result<()> {
        connection.write_all(&vec![0; bytes]).await?;
        connection.flush().await
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_whose_socket_takes_nothing_ends_and_one_that_is_slow_does_not() {
        let limits = Limits { preface: Duration::from_secs(3600), ..Limits::default() };
        let guard = guard(limits.clone());
        let (mut slow, mut far) = connection(&guard, 1024);
        let reads = tokio::spawn(async move {
            for _ in 0..40 {
                tokio::time::sleep(Duration::from_secs(9)).await;
                far.read_exact(&mut [0; 1024]).await.unwrap();
            }
        });
        send(&mut slow, 40 * 1024).await.unwrap();
        reads.await.unwrap();
        let (mut stuck, _far) = connection(&guard, 1024);
        let begun = tokio::time::Instant::now();
        let error = send(&mut stuck, 40 * 1024).await.unwrap_err();
        assert_eq!((error.kind(), begun.elapsed().as_secs()), (ErrorKind::TimedOut, limits.socket_stall.as_secs()));
        assert_eq!(error.to_string(), "nothing of what was sent was taken for 10 s");
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_is_read_no_faster_than_frames_of_no_call_may_come() {
        let rate = Rate { burst: 10, every: Duration::from_secs(1) };
        let guard = guard(Limits { frames_of_no_call: rate, ..Limits::default() });
        let (mut connection, mut far) = connection(&guard, 1024);
        far.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").await.unwrap();
        for _ in 0..30 {
            far.write_all(b"\0\0\x08\x06\x01\0\0\0\0 a ping ").await.unwrap();
        }
        drop(far);
        let begun = tokio::time::Instant::now();
        let (mut read, mut piece) = (0, [0; 17]);
        while let bytes @ 1.. = connection.read(&mut piece).await.unwrap() {
            read += bytes;
        }
        assert_eq!((read, begun.elapsed().as_secs()), (PREFACE_BYTES + 30 * 17, 20));
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_that_waits_for_its_socket_is_cut_all_the_same() {
        let guard = guard(Limits { socket_stall: Duration::from_secs(3600), ..Limits::default() });
        let (mut stuck, _far) = connection(&guard, 1024);
        let cut = guard.cut.clone();
        tokio::spawn(async move { cut.cancel() });
        let error = send(&mut stuck, 40 * 1024).await.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::ConnectionAborted);
    }
}
