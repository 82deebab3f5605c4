//! The limits of the HTTP side, with where they come from.

use std::time::Duration;

/// What the HTTP side grants. The defaults suit some tabs and some scripts beside the controllers, who use gRPC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Of connections, and how they are watched; the rest is the service's own. A browser opens up to six connections.
    pub connections: taxel_rpc::Limits,
    /// Streams at once over all connections, of which the daemon's own limit counts each as well: so pages can never take
    /// all places from controllers.
    pub streams: usize,
    /// A connection whose request head is not there by then is closed, an idle one too.
    pub head: Duration,
    /// A request body that is not there by then is refused.
    pub body: Duration,
    /// A stream that has nothing to tell sends an empty comment this often, so that a peer that is gone is found.
    pub comment: Duration,
    /// What is still open so long after the shutdown began is cut.
    pub drain: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        // Only this machine's addresses are served, which are one peer: there is no limit for each.
        let connections = taxel_rpc::Limits { connections: 64, ..taxel_rpc::Limits::default() };
        Self {
            connections,
            streams: 32,
            head: Duration::from_secs(10),
            body: Duration::from_secs(10),
            comment: Duration::from_secs(5),
            drain: Duration::from_secs(1),
        }
    }
}
