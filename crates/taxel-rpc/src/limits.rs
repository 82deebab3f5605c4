//! The limits of the service, with where they come from.

use std::time::Duration;

/// What one server grants. The defaults suit one robot with a handful of controllers and an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at once. For a further one the longest idle connection is closed; an idle one costs about 24 KiB.
    pub connections: usize,
    /// Of one peer: an account on the Unix socket, or an address. So many more than it may have streams and long calls that
    /// it always has one that is idle, which makes room for the next.
    pub connections_per_peer: usize,
    /// Streams at once over all connections. Measured elsewhere: 64 subscribers at 1 kHz stay below 1 ms at the 99th
    /// percentile on two cores.
    pub streams: usize,
    /// Of one peer: an account, a certificate, the holder of a token, or an address.
    pub streams_per_peer: usize,
    /// Of all, those that only operators can have.
    pub streams_reserved: usize,
    /// Calls at once that take tens of milliseconds or megabytes: imports, exports, proposals.
    pub long_calls: usize,
    /// Of one peer.
    pub long_calls_per_peer: usize,
    /// Of all, those that only operators can have.
    pub long_calls_reserved: usize,
    /// All connections are checked this often.
    pub check_every: Duration,
    /// A connection that has not sent the HTTP/2 preface after so many checks is closed. An honest client sends it at once.
    pub preface_checks: u32,
    /// A connection is closed that takes nothing of its answers for so many checks, though something waits for it.
    pub untaken_checks: u32,
    /// A stream that pushes no scan for so long ends, and another may begin.
    pub push_pause: Duration,
    /// How long a command may take. A tare watches the skin for up to a minute, as it is configured.
    pub command: Duration,
    /// A ping goes out after so long a silence of the peer ...
    pub keepalive_interval: Duration,
    /// ... and the connection is closed if it is not answered by then.
    pub keepalive_timeout: Duration,
    /// What is still open so long after the shutdown began is closed.
    pub drain: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 128,
            connections_per_peer: 96,
            streams: 128,
            streams_per_peer: 64,
            streams_reserved: 8,
            long_calls: 8,
            long_calls_per_peer: 4,
            long_calls_reserved: 2,
            check_every: Duration::from_secs(1),
            preface_checks: 5,
            untaken_checks: 10,
            push_pause: Duration::from_secs(10),
            command: Duration::from_secs(90),
            keepalive_interval: Duration::from_secs(10),
            keepalive_timeout: Duration::from_secs(5),
            drain: Duration::from_secs(2),
        }
    }
}
