//! Every bound of the service in one place, with where it comes from.

use std::time::Duration;

/// What one server grants. The defaults suit one robot with a handful of controllers and an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at once; a further one is closed on arrival. An idle one costs about 24 KiB.
    pub connections: usize,
    /// A connection that has not sent the HTTP/2 preface by then is closed: without this it would live for ever.
    pub preface: Duration,
    /// Calls at once on one connection; the client queues further ones.
    pub calls_per_connection: u32,
    /// Streams at once over all connections. Measured elsewhere: 64 subscribers at 1 kHz stay below 1 ms at the 99th
    /// percentile on two cores.
    pub streams: usize,
    /// A stream whose reader leaves a value unread for so long ends with ABORTED.
    pub unread: Duration,
    /// How long a command may take. A tare watches the skin for seconds.
    pub command: Duration,
    /// Largest request, in bytes; a request is a few names and numbers.
    pub request_bytes: usize,
    /// Largest ImportModelSet request, and largest answer, in bytes.
    pub models_bytes: usize,
    /// Largest block of request headers, in bytes.
    pub header_bytes: u32,
    /// A ping goes out after so long a silence of the peer ...
    pub keepalive_interval: Duration,
    /// ... and the connection is closed if it is not answered by then.
    pub keepalive_timeout: Duration,
    /// What is still open so long after the shutdown began is cut.
    pub drain: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 128,
            preface: Duration::from_secs(3),
            calls_per_connection: 64,
            streams: 64,
            unread: Duration::from_secs(5),
            command: Duration::from_secs(60),
            request_bytes: 64 << 10,
            models_bytes: 16 << 20,
            header_bytes: 8 << 10,
            keepalive_interval: Duration::from_secs(10),
            keepalive_timeout: Duration::from_secs(5),
            drain: Duration::from_secs(2),
        }
    }
}
