//! The server: connections, their number and their end.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use taxel_rpc::{Connections, Handle, SharedServices};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::call::Client;
use crate::history::History;
use crate::limits::Limits;
use crate::site::{Site, router};

/// A failed accept mostly means that file descriptors ran out; it is tried again after this pause.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Connections that the kernel may hold before they are accepted.
const BACKLOG: u32 = 128;

/// Bytes of answers that the kernel may hold for one connection. A peer that does not read finds this much of old values
/// before the newest.
const SEND_BUFFER_BYTES: u32 = 128 << 10;

/// Largest request head, and what of answers may wait for the kernel, in bytes.
const BUFFER_BYTES: usize = 16 << 10;

/// What a page needs.
pub struct Options {
    /// The daemon's services.
    pub services: SharedServices,
    /// The engine, whose forces are kept for pages that open later.
    pub handle: Handle,
    /// Names beside localhost and loopback addresses by which the page may be asked for: those of a proxy before it.
    pub names: Vec<String>,
    /// Bounds.
    pub limits: Limits,
}

/// Binds the page's address. Needs a runtime of tokio's.
///
/// # Errors
/// If the address is taken or is not this machine's.
pub fn bind(address: SocketAddr) -> io::Result<std::net::TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
    socket.set_reuseaddr(true)?;
    socket.set_send_buffer_size(SEND_BUFFER_BYTES)?; // connections have it from here
    socket.bind(address)?;
    socket.listen(BACKLOG)?.into_std()
}

/// Serves the page until the shutdown, then at most [`Limits::drain`] longer.
///
/// # Errors
/// If the listener cannot be used on this runtime, or the compiled descriptors cannot be read.
pub async fn serve(listener: std::net::TcpListener, options: Options, shutdown: CancellationToken) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let Options { services, handle, names, limits } = options;
    let connections = Connections::with_limits(limits.connections.clone());
    let history = Arc::new(History::new(handle.clone()));
    let site = Site::new(services, Arc::clone(&history), names, limits.clone()).map_err(io::Error::other)?;
    let mut kept = JoinSet::new(); // ends with this call
    for patch in 0..handle.patches() {
        let history = Arc::clone(&history);
        kept.spawn(async move { history.keep(patch).await });
    }
    let mut server = Server { router: router(site), connections: connections.clone(), limits, tasks: JoinSet::new() };
    let accept = async {
        loop {
            match listener.accept().await {
                Ok((io, address)) => server.admit(io, address, shutdown.clone()),
                Err(error) => {
                    tracing::warn!(%error, "page: a connection was not accepted");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
            while server.tasks.try_join_next().is_some() {} // how it ended is the peer's affair
        }
    };
    tokio::select! {
        () = shutdown.cancelled() => {}
        never = connections.keep() => match never {},
        never = accept => match never {},
    }
    drop(listener);
    let Server { limits, mut tasks, .. } = server;
    let closing = async { while tasks.join_next().await.is_some() {} };
    let _ = tokio::time::timeout(limits.drain, closing).await; // what is left is cut when the set is dropped
    Ok(())
}

struct Server {
    router: Router,
    connections: Connections,
    limits: Limits,
    tasks: JoinSet<()>,
}

impl Server {
    fn admit(&mut self, io: TcpStream, address: SocketAddr, shutdown: CancellationToken) {
        let Some(seat) = self.connections.admit(&io, address.ip()) else { return };
        let _ = io.set_nodelay(true); // an event is small and must not wait for the next; without it it comes late
        let service = self.router.clone().layer(Extension(Client { address, seat }));
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new()).header_read_timeout(self.limits.head).max_buf_size(BUFFER_BYTES);
        self.tasks.spawn(async move {
            let served = http.serve_connection(TokioIo::new(io), TowerToHyperService::new(service));
            tokio::pin!(served);
            let ended = tokio::select! {
                ended = &mut served => ended,
                () = shutdown.cancelled() => {
                    served.as_mut().graceful_shutdown();
                    served.await
                }
            };
            if let Err(error) = ended {
                tracing::debug!(%address, %error, "page: a connection");
            }
        });
    }
}
