//! Where connections come from: loopback TCP, a Unix socket, TLS.

use std::io;
use std::net::SocketAddr;
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;
use std::time::Duration;

use futures_util::stream::{self, Stream, StreamExt};
use nix::sys::socket::{setsockopt, sockopt};
use tokio::net::unix::UCred;
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};

use crate::access::accounts::look_up;
use crate::access::origin::{Account, Origin, PeerKey};
use crate::connection::{Connection, Io};
use crate::connections::Connections;
use crate::refusals::Refusals;
#[cfg(feature = "tls")]
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
    #[cfg(feature = "tls")]
    Tls(std::net::TcpListener, Tls),
}

/// The same on a runtime.
enum Bound {
    Tcp(TcpListener),
    Unix(UnixListener),
    #[cfg(feature = "tls")]
    Tls(TcpListener, Tls),
}

/// A connection of which only its other end's address or account is known.
enum Arrival {
    Tcp(TcpStream, SocketAddr),
    Unix(UnixStream, UCred),
    #[cfg(feature = "tls")]
    Tls(TcpStream, SocketAddr, Tls),
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
                Ok(arrival) => {
                    if let Some(ticket) = connections.arrive(&arrival, arrival.key()) {
                        return Some(((arrival, ticket), (bound, connections)));
                    }
                }
                Err(error) => {
                    tracing::warn!(%error, "a connection was not accepted");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    });
    let known = arrivals.map(move |(arrival, ticket)| {
        let refusals = Arc::clone(&refusals);
        async move {
            let key = arrival.key();
            let known = arrival.known(&refusals).await;
            let told =
                known.inspect_err(|why| refusals.tell(("handshake", &key), || format!("no TLS with {key}: {why}")));
            let (io, origin) = told.ok()?;
            Some(Ok(Connection::new(io, origin, ticket)))
        }
    });
    known.buffer_unordered(SIDE_BY_SIDE).filter_map(std::future::ready)
}

impl Bound {
    fn new(listener: Listener) -> io::Result<Self> {
        let tcp = |listener: std::net::TcpListener| {
            listener.set_nonblocking(true)?;
            TcpListener::from_std(listener)
        };
        Ok(match listener {
            Listener::Tcp(listener) => Self::Tcp(tcp(listener)?),
            Listener::Unix(listener) => {
                listener.set_nonblocking(true)?;
                Self::Unix(UnixListener::from_std(listener)?)
            }
            #[cfg(feature = "tls")]
            Listener::Tls(listener, tls) => Self::Tls(tcp(listener)?, tls),
        })
    }

    async fn accept(&self) -> io::Result<Arrival> {
        Ok(match self {
            Self::Tcp(listener) => {
                let (stream, address) = tcp(listener).await?;
                Arrival::Tcp(stream, address)
            }
            Self::Unix(listener) => {
                let (stream, _) = listener.accept().await?;
                let peer = stream.peer_cred()?;
                Arrival::Unix(stream, peer)
            }
            #[cfg(feature = "tls")]
            Self::Tls(listener, tls) => {
                let (stream, address) = tcp(listener).await?;
                Arrival::Tls(stream, address, tls.clone())
            }
        })
    }
}

async fn tcp(listener: &TcpListener) -> io::Result<(TcpStream, SocketAddr)> {
    let (stream, address) = listener.accept().await?;
    // A force sample is small and must not wait for the next.
    stream.set_nodelay(true)?;
    setsockopt(&stream, sockopt::TcpUserTimeout, &TCP_USER_TIMEOUT_MS)?;
    Ok((stream, address))
}

impl AsFd for Arrival {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Tcp(stream, _) => stream.as_fd(),
            Self::Unix(stream, _) => stream.as_fd(),
            #[cfg(feature = "tls")]
            Self::Tls(stream, ..) => stream.as_fd(),
        }
    }
}

impl Arrival {
    fn key(&self) -> PeerKey {
        match self {
            Self::Tcp(_, address) => PeerKey::of(address.ip()),
            Self::Unix(_, peer) => PeerKey::User(peer.uid()),
            #[cfg(feature = "tls")]
            Self::Tls(_, address, _) => PeerKey::of(address.ip()),
        }
    }

    /// Who it is, or why that cannot be told. The watch over connections ends a handshake that takes too long.
    async fn known(self, refusals: &Refusals) -> Result<(Box<dyn Io>, Origin), String> {
        Ok(match self {
            Self::Tcp(stream, address) => (Box::new(stream), Origin::of_tcp(address)),
            Self::Unix(stream, peer) => {
                let (uid, gid) = (peer.uid(), peer.gid());
                let looked_up = tokio::task::spawn_blocking(move || look_up(uid, gid));
                let account = match tokio::time::timeout(LOOK_UP_MAX, looked_up).await {
                    Ok(Ok(account)) => account,
                    _ => {
                        refusals.tell(("account", &PeerKey::User(uid)), || {
                            format!("user id {uid}: the system does not say who that is: no grant counts for it")
                        });
                        Account::nameless(uid)
                    }
                };
                (Box::new(stream), Origin::Unix(account.into(), peer.pid()))
            }
            #[cfg(feature = "tls")]
            Self::Tls(stream, address, tls) => {
                let (stream, certificate) = tls.handshake(stream).await?;
                (Box::new(stream), Origin::Tls(address, certificate.into()))
            }
        })
    }
}
