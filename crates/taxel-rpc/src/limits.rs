//! Every bound of the service in one place, with where it comes from.

use std::time::Duration;

/// How often something may be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// So many at once ...
    pub burst: u32,
    /// ... and then one after so long.
    pub every: Duration,
}

/// What one server grants. The defaults suit one robot with a handful of controllers and an operator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at once; a further one is closed on arrival. An idle one costs about 24 KiB.
    pub connections: usize,
    /// Of one peer: an account on the Unix socket, a certificate, or an address.
    pub connections_per_peer: usize,
    /// Of all, those that only whoever is an operator by account, certificate or address can have.
    pub connections_reserved: usize,
    /// Connections that have not yet sent the HTTP/2 preface; beyond, the oldest of the peer with the most is closed. An
    /// honest client sends it at once.
    pub unproven: usize,
    /// A connection that has not sent the HTTP/2 preface by then is closed: without this it would live for ever.
    pub preface: Duration,
    /// Calls at once on one connection; the client queues further ones. Well above the streams, so that one stream too
    /// many is refused with its reason and calls beside the streams go on.
    pub calls_per_connection: u32,
    /// Streams at once over all connections. Measured elsewhere: 64 subscribers at 1 kHz stay below 1 ms at the 99th
    /// percentile on two cores.
    pub streams: usize,
    /// Of one peer.
    pub streams_per_peer: usize,
    /// Of all, those that only operators can have.
    pub streams_reserved: usize,
    /// Streams that are being opened: their request has not come whole yet. One holds up to [`Limits::request_bytes`] of it
    /// and the head.
    pub opening: usize,
    /// Of one peer.
    pub opening_per_peer: usize,
    /// Of all, those that only operators can have.
    pub opening_reserved: usize,
    /// Calls at once that do not stream, each from its head until its answer is out. One holds up to
    /// [`Limits::request_bytes`] of its request and most often less of its answer.
    pub calls: usize,
    /// Of one peer.
    pub calls_per_peer: usize,
    /// Of all, those that only operators can have.
    pub calls_reserved: usize,
    /// Of these, exported model sets, comparisons, proposals of recalibrations and long lists. The text of a forearm's set
    /// takes 1 MB, and work of tens of milliseconds.
    pub large_answers: usize,
    /// Of one peer.
    pub large_answers_per_peer: usize,
    /// Of all, those that only operators can have.
    pub large_answers_reserved: usize,
    /// Sessions of which samples are exported or a certificate is made at once. One of 36,000 scans of 230 taxels takes 10
    /// MB of memory.
    pub exports: usize,
    /// Of one peer.
    pub exports_per_peer: usize,
    /// Of all, those that only operators can have.
    pub exports_reserved: usize,
    /// ImportModelSet requests that are taken in at once; further ones wait. One takes some five times
    /// [`Limits::models_bytes`] while it is read.
    pub imports: usize,
    /// The body of a request that is one message has to come on within this time.
    pub body_pause: Duration,
    /// Frames of a connection that bring no call on, such as pings and resets: the rate at which it is read beyond what it may
    /// send at first and for what it has taken (`paced.rs`), and how many of these it can save up. A subscriber at 1 kHz gives a
    /// window back some ten times a second.
    pub frames_of_no_call: Rate,
    /// Calls of one peer that change something. Each costs two rows of the audit log, about 1 KiB.
    pub commands: Rate,
    /// Sessions that one peer may start. An aborted one is kept, about 2 KiB.
    pub session_starts: Rate,
    /// A connection is closed whose socket takes nothing of what is to be sent for so long. Streams end before that, so that
    /// a reader that is merely slow is told.
    pub socket_stall: Duration,
    /// A stream whose reader leaves a value unread for so long ends with ABORTED, and so does any answer of which nothing is
    /// taken for so long.
    pub unread: Duration,
    /// Answers of one connection that may have ended so and not yet be taken; beyond, the connection is closed, because
    /// HTTP/2 keeps up to 32 KiB of each.
    pub untaken: usize,
    /// A stream that pushes no scan for so long ends, and another may begin.
    pub push_pause: Duration,
    /// How long a command may take. A tare watches the skin for up to a minute, as it is configured.
    pub command: Duration,
    /// Largest request, in bytes; a request is a few names and numbers.
    pub request_bytes: usize,
    /// Largest ImportModelSet request, and largest answer, in bytes.
    pub models_bytes: usize,
    /// What a client may send ahead of what is read, on one stream and on one connection, in bytes.
    pub ahead_bytes: [u32; 2],
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
            connections_per_peer: 96,
            connections_reserved: 8,
            unproven: 64,
            preface: Duration::from_secs(3),
            calls_per_connection: 256,
            streams: 64,
            streams_per_peer: 100,
            streams_reserved: 8,
            opening: 192,
            opening_per_peer: 128,
            opening_reserved: 16,
            calls: 96,
            calls_per_peer: 64,
            calls_reserved: 16,
            large_answers: 8,
            large_answers_per_peer: 4,
            large_answers_reserved: 2,
            exports: 2,
            exports_per_peer: 1,
            exports_reserved: 1,
            imports: 1,
            body_pause: Duration::from_secs(5),
            frames_of_no_call: Rate { burst: 20_000, every: Duration::from_millis(10) },
            commands: Rate { burst: 100, every: Duration::from_millis(200) },
            session_starts: Rate { burst: 20, every: Duration::from_secs(6) },
            socket_stall: Duration::from_secs(10),
            unread: Duration::from_secs(5),
            untaken: 8,
            push_pause: Duration::from_secs(10),
            command: Duration::from_secs(90),
            request_bytes: 64 << 10,
            models_bytes: 16 << 20,
            ahead_bytes: [64 << 10, 256 << 10],
            header_bytes: 8 << 10,
            keepalive_interval: Duration::from_secs(10),
            keepalive_timeout: Duration::from_secs(5),
            drain: Duration::from_secs(2),
        }
    }
}
