//! The server: connections, their number and their end.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::task::JoinSet;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

use crate::call::{Permits, Services};
use crate::connection::Connection;
use crate::limits::Limits;
use crate::places::{NoPlace, Places};
use crate::site::{Shows, Site};

/// A failed accept mostly means that file descriptors ran out; it is tried again after this pause.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Connections that the kernel may hold before they are accepted.
const BACKLOG: u32 = 128;

/// Refused connections are told in the log this often at most.
const TELL_EVERY: Duration = Duration::from_secs(10);

/// What a page needs.
pub struct Options {
    /// The daemon's services.
    pub services: Services,
    /// Who may call what, as the services judge it.
    pub permits: Permits,
    /// What is served.
    pub shows: Shows,
    /// Names beside localhost and loopback addresses by which the page may be asked for: those of a proxy before it.
    pub names: Vec<String>,
    /// Bounds.
    pub limits: Limits,
}

/// Binds the page's address. Needs a runtime of tokio's.
///
/// # Errors
/// If the address is taken or is not this machine's.
pub fn bind(address: SocketAddr, limits: &Limits) -> io::Result<std::net::TcpListener> {
    let socket = if address.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
    socket.set_reuseaddr(true)?;
    socket.set_send_buffer_size(limits.send_buffer_bytes)?; // connections have it from here
    socket.bind(address)?;
    socket.listen(BACKLOG)?.into_std()
}

/// Serves the page until the shutdown, then at most [`Limits::drain`] longer.
///
/// # Errors
/// If the listener cannot be used on this runtime, or the compiled descriptors cannot be read.
pub async fn serve(listener: std::net::TcpListener, options: Options, shutdown: CancellationToken) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let Options { services, permits, shows, names, limits } = options;
    let site = Site::new((services, permits), shows, names, limits.clone()).map_err(io::Error::other)?;
    let mut server = Server {
        site: Arc::new(site),
        places: Places::new(limits.connections, limits.connections_per_address),
        limits,
        shutdown: shutdown.clone(),
        connections: JoinSet::new(),
        refused: Refused::default(),
    };
    loop {
        tokio::select! {
            () = shutdown.cancelled() => break,
            accepted = listener.accept() => match accepted {
                Ok((io, address)) => server.admit(io, address),
                Err(error) => {
                    tracing::warn!(%error, "page: a connection was not accepted");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            },
            Some(_) = server.connections.join_next() => {} // how it ended is the peer's affair
        }
    }
    drop(listener);
    let drain = server.limits.drain;
    let closing = async { while server.connections.join_next().await.is_some() {} };
    let _ = tokio::time::timeout(drain, closing).await; // what is left is cut when the set is dropped
    Ok(())
}

struct Server {
    site: Arc<Site>,
    places: Places,
    limits: Limits,
    shutdown: CancellationToken,
    connections: JoinSet<()>,
    refused: Refused,
}

impl Server {
    fn admit(&mut self, io: TcpStream, address: SocketAddr) {
        let place = match self.places.arrive(address.ip()) {
            Ok(place) => place,
            Err(why) => return self.refused.tell(why),
        };
        let _ = io.set_nodelay(true); // an event is small and must not wait for the next; without it it comes late
        let connection = Connection::new(io, self.limits.unread);
        let (site, shutdown) = (Arc::clone(&self.site), self.shutdown.clone());
        let limits = &self.limits;
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new()).header_read_timeout(limits.head).max_buf_size(limits.head_bytes);
        self.connections.spawn(async move {
            let held = Arc::clone(&place);
            let service = service_fn(move |request| {
                let (site, place) = (Arc::clone(&site), Arc::clone(&held));
                async move { Ok::<_, std::convert::Infallible>(site.answer(request, address, place).await) }
            });
            let served = http.serve_connection(TokioIo::new(connection), service);
            tokio::pin!(served);
            let ended = tokio::select! {
                ended = &mut served => ended,
                () = place.evicted() => {
                    tracing::debug!(%address, "page: a connection made room for another one");
                    return;
                }
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

/// Connections beyond the limit, told seldom.
#[derive(Default)]
struct Refused {
    count: u64,
    told: Option<Instant>,
}

impl Refused {
    fn tell(&mut self, NoPlace(limit): NoPlace) {
        self.count += 1;
        if self.told.is_none_or(|told| told.elapsed() >= TELL_EVERY) {
            tracing::warn!(
                so_far = self.count,
                "page: connection refused: {limit} are being served, which is the limit"
            );
            self.told = Some(Instant::now());
        }
    }
}
