//! Where connections come from: loopback TCP, a Unix socket, TLS.

use std::io;
use std::pin::Pin;
use std::time::Duration;

use futures_util::StreamExt;
use futures_util::stream::{self, Stream};
use tokio::net::{TcpListener, UnixListener};

use crate::access::origin::{Account, Origin, PeerKey};
use crate::guard::{Connection, Guard};
#[cfg(feature = "tls")]
use crate::shares::{NoPlace, What};
#[cfg(feature = "tls")]
use crate::tls::Tls;

/// A failed accept mostly means that file descriptors ran out; it is tried again after this pause.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Accounts that the system is asked for at the same time.
const LOOKED_UP_AT_ONCE: usize = 8;

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

type Incoming = Pin<Box<dyn Stream<Item = io::Result<Connection>> + Send>>;

/// Accepts connections for ever on all listeners; no error of a connection ends it.
///
/// # Errors
/// If the runtime does not take a listener.
pub(crate) fn accept(
    listeners: Vec<Listener>,
    guard: &Guard,
) -> io::Result<impl Stream<Item = io::Result<Connection>> + use<>> {
    let streams = listeners.into_iter().map(|listener| incoming(listener, guard.clone()));
    Ok(stream::select_all(streams.collect::<io::Result<Vec<_>>>()?))
}

fn incoming(listener: Listener, guard: Guard) -> io::Result<Incoming> {
    Ok(match listener {
        Listener::Tcp(listener) => {
            listener.set_nonblocking(true)?;
            let listener = TcpListener::from_std(listener)?;
            Box::pin(stream::unfold((listener, guard), |(listener, guard)| async {
                let connection = next_tcp(&listener, &guard).await;
                Some((Ok(connection), (listener, guard)))
            }))
        }
        Listener::Unix(listener) => {
            listener.set_nonblocking(true)?;
            Box::pin(with_accounts(UnixListener::from_std(listener)?, guard))
        }
        #[cfg(feature = "tls")]
        Listener::Tls(listener, tls) => {
            listener.set_nonblocking(true)?;
            Box::pin(with_tls(TcpListener::from_std(listener)?, tls, guard))
        }
    })
}

/// What came of an accept; after an error nothing, and a pause.
async fn accepted<T>(accepted: io::Result<T>) -> Option<T> {
    match accepted {
        Ok(accepted) => Some(accepted),
        Err(error) => {
            tracing::warn!(%error, "a connection was not accepted");
            tokio::time::sleep(ACCEPT_PAUSE).await;
            None
        }
    }
}

async fn next_tcp(listener: &TcpListener, guard: &Guard) -> Connection {
    loop {
        let Some((stream, address)) = accepted(listener.accept().await).await else { continue };
        // A force sample is small and must not wait for the next.
        if accepted(stream.set_nodelay(true)).await.is_none() {
            continue;
        }
        if let Some(connection) = guard.let_in(Box::new(stream), Origin::of_tcp(address)) {
            return connection;
        }
    }
}

/// Accounts are looked up side by side: the system may ask a server for one, and the others must not wait for that.
fn with_accounts(listener: UnixListener, guard: Guard) -> impl Stream<Item = io::Result<Connection>> {
    let arrivals = stream::unfold(listener, |listener| async {
        loop {
            let Some((stream, _)) = accepted(listener.accept().await).await else { continue };
            if let Some(peer) = accepted(stream.peer_cred()).await {
                return Some(((stream, peer), listener));
            }
        }
    });
    let looked_up = arrivals.map(move |(stream, peer)| {
        let guard = guard.clone();
        async move {
            let account = guard.access.accounts().of(peer.uid(), peer.gid());
            let account = match tokio::time::timeout(guard.limits.preface, account).await {
                Ok(account) => account,
                Err(_) => {
                    let key = PeerKey::User(peer.uid());
                    guard.refusals.tell(("account", &key), || {
                        format!("{key}: the system does not say who that is: taken for one without name and groups")
                    });
                    Account::nameless(peer.uid()).into()
                }
            };
            guard.let_in(Box::new(stream), Origin::Unix(account, peer.pid()))
        }
    });
    looked_up.buffer_unordered(LOOKED_UP_AT_ONCE).filter_map(|connection| std::future::ready(connection.map(Ok)))
}

/// Handshakes side by side: how many there are is bounded by the guard, which evicts.
#[cfg(feature = "tls")]
fn with_tls(listener: TcpListener, tls: Tls, guard: Guard) -> impl Stream<Item = io::Result<Connection>> {
    let most = 2 * guard.limits.unproven.max(1);
    let arrivals = stream::unfold(listener, |listener| async {
        loop {
            let Some((stream, address)) = accepted(listener.accept().await).await else { continue };
            if accepted(stream.set_nodelay(true)).await.is_some() {
                return Some(((stream, address), listener));
            }
        }
    });
    let handshakes = arrivals.map(move |(stream, address)| {
        let (tls, guard) = (tls.clone(), guard.clone());
        async move {
            let key = PeerKey::of(address.ip());
            // Whose share it will take is known only with the certificate.
            if guard.shares.is_full(What::Connection) {
                guard.refusals.tell(("connection", &key), || {
                    format!(
                        "a connection from {address} was refused: {}",
                        NoPlace::All(guard.limits.connections).text(What::Connection, &key)
                    )
                });
                return None;
            }
            let mut ticket = guard.unproven.arrive(key.clone());
            let shaken = tokio::select! {
                shaken = tls.handshake(stream) => shaken,
                () = ticket.evicted() => Err("too many others wait".to_owned()),
                () = tokio::time::sleep(guard.limits.preface) => Err("it took too long".to_owned()),
                () = guard.cut.cancelled() => Err("the daemon stops".to_owned()),
            };
            match shaken {
                Ok((stream, certificate)) => {
                    let origin = Origin::Tls(address, certificate.into());
                    drop(ticket);
                    guard.let_in(Box::new(stream), origin)
                }
                Err(why) => {
                    guard.refusals.tell(("handshake", &key), || format!("no TLS with {address}: {why}"));
                    None
                }
            }
        }
    });
    handshakes.buffer_unordered(most).filter_map(|connection| std::future::ready(connection.map(Ok)))
}
