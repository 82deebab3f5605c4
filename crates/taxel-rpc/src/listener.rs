//! Where connections come from: loopback TCP, a Unix socket, TLS.

use std::io;
use std::net::SocketAddr;
use std::os::fd::{AsFd, OwnedFd};
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use futures_util::stream::{self, Stream, StreamExt};
use nix::sys::socket::{setsockopt, sockopt};
use tokio::net::unix::UCred;
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};

use crate::access::origin::look_up;
use crate::access::origin::{Account, Origin, peer_at};
use crate::connection::{Connection, Io};
use crate::connections::Connections;
use crate::refusals::Refusals;
use crate::tls::Tls;

/// A failed accept mostly means that file descriptors ran out; it is tried again after this pause.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// The kernel closes a TCP connection whose peer has acknowledged nothing of what was sent for so long.
const TCP_USER_TIMEOUT_MS: u32 = 10_000;

/// The system says within this time who an account is, for which it may have to ask a server.
const LOOK_UP_MAX: Duration = Duration::from_secs(5);

/// Handshakes and look-ups that go on side by side. Each holds the place of its connection, so that these end it first.
const SIDE_BY_SIDE: usize = 1024;

/// Where connections come from. The caller binds it, so that a taken address is reported at start.
#[derive(Debug)]
pub enum Listener {
    /// TCP without encryption: for this machine, or for a net that is trusted as a whole.
    Tcp(std::net::TcpListener),
    /// A Unix socket: its file's mode says who may connect, the kernel says who does.
    Unix(std::os::unix::net::UnixListener),
    /// TCP with TLS 1.3 and client certificates.
    Tls(std::net::TcpListener, Tls),
}

/// The same on a runtime.
enum Bound {
    Tcp(TcpListener, Option<Tls>),
    Unix(UnixListener),
}

/// A connection with who is at its other end, or why that cannot be told.
type Known = Result<(Box<dyn Io>, Origin), String>;

/// A connection of which only its other end's address or account is known.
struct Arrival {
    /// A copy of its descriptor.
    socket: OwnedFd,
    /// Whose share of the service it takes.
    peer: String,
    /// The watch over connections ends a handshake that takes too long.
    known: Pin<Box<dyn Future<Output = Known> + Send>>,
}

/// Accepts connections for ever on all listeners; no error of a connection ends it.
///
/// # Errors
/// If the runtime does not take a listener.
pub(crate) fn accept(
    listeners: Vec<Listener>,
    connections: &Connections,
    refusals: &Arc<Refusals>,
) -> io::Result<impl Stream<Item = io::Result<Connection>> + use<>> {
    let bound = listeners.into_iter().map(Bound::new).collect::<io::Result<Vec<_>>>()?;
    let incoming = |bound| incoming(bound, connections.clone(), Arc::clone(refusals)).boxed();
    Ok(stream::select_all(bound.into_iter().map(incoming)))
}

fn incoming(
    bound: Bound,
    connections: Connections,
    refusals: Arc<Refusals>,
) -> impl Stream<Item = io::Result<Connection>> {
    let arrivals = stream::unfold((bound, connections), |(bound, connections)| async {
        loop {
            match bound.accept().await {
                Ok(Arrival { socket, peer, known }) => {
                    if let Some(seat) = connections.arrive(socket, &peer) {
                        return Some(((peer, known, seat), (bound, connections)));
                    }
                }
                Err(error) => {
                    tracing::warn!(%error, "a connection was not accepted");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    });
    let connected = arrivals.map(move |(peer, known, seat)| {
        let refusals = Arc::clone(&refusals);
        async move {
            let refused = |why: &String| refusals.tell(("handshake", &peer), || format!("no TLS with {peer}: {why}"));
            let (io, origin) = known.await.inspect_err(refused).ok()?;
            Some(Ok(Connection::new(io, origin, seat)))
        }
    });
    connected.buffer_unordered(SIDE_BY_SIDE).filter_map(std::future::ready)
}

impl Bound {
    fn new(listener: Listener) -> io::Result<Self> {
        let tcp = |listener: std::net::TcpListener| {
            listener.set_nonblocking(true)?;
            TcpListener::from_std(listener)
        };
        Ok(match listener {
            Listener::Tcp(listener) => Self::Tcp(tcp(listener)?, None),
            Listener::Tls(listener, tls) => Self::Tcp(tcp(listener)?, Some(tls)),
            Listener::Unix(listener) => {
                listener.set_nonblocking(true)?;
                Self::Unix(UnixListener::from_std(listener)?)
            }
        })
    }

    async fn accept(&self) -> io::Result<Arrival> {
        match self {
            Self::Unix(listener) => {
                let (stream, _) = listener.accept().await?;
                let (socket, process) = (stream.as_fd().try_clone_to_owned()?, stream.peer_cred()?);
                let peer = format!("user id {}", process.uid());
                Ok(Arrival { socket, peer, known: Box::pin(of_account(stream, process)) })
            }
            Self::Tcp(listener, tls) => {
                let (stream, address) = listener.accept().await?;
                // A force sample is small and must not wait for the next.
                stream.set_nodelay(true)?;
                setsockopt(&stream, sockopt::TcpUserTimeout, &TCP_USER_TIMEOUT_MS)?;
                let (socket, peer) = (stream.as_fd().try_clone_to_owned()?, peer_at(address.ip()));
                Ok(Arrival { socket, peer, known: Box::pin(of_address(stream, address, tls.clone())) })
            }
        }
    }
}

async fn of_address(stream: TcpStream, address: SocketAddr, tls: Option<Tls>) -> Known {
    let Some(tls) = tls else { return Ok((Box::new(stream), Origin::of_tcp(address))) };
    let (stream, certificate) = tls.handshake(stream).await?;
    Ok((Box::new(stream), Origin::Tls(address, certificate.into())))
}

async fn of_account(stream: UnixStream, process: UCred) -> Known {
    let (uid, gid) = (process.uid(), process.gid());
    let looked_up = tokio::task::spawn_blocking(move || look_up(uid, gid));
    let account = match tokio::time::timeout(LOOK_UP_MAX, looked_up).await {
        Ok(Ok(account)) => account,
        _ => {
            tracing::warn!("user id {uid}: the system does not say who that is: no grant counts for it");
            Account { uid, user: None, groups: Vec::new() }
        }
    };
    Ok((Box::new(stream), Origin::Unix(account.into(), process.pid())))
}
