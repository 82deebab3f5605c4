//! Who asks.

use std::net::SocketAddr;
use std::sync::Arc;

use taxel_rpc::Seat;

/// The other end of a connection, among the extensions of each request.
#[derive(Clone, Debug)]
pub(crate) struct Client {
    pub(crate) address: SocketAddr,
    pub(crate) seat: Arc<Seat>,
}
