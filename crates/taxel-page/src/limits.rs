//! Every bound of the HTTP side in one place, with where it comes from.

use std::time::Duration;

/// What the HTTP side grants. The defaults suit some tabs and some scripts beside the controllers, who use gRPC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Connections at once. A further one takes the place of the longest idle one of the address that has the most; while
    /// all are being served it is closed on arrival. A browser opens up to six.
    pub connections: usize,
    /// Of one address, but for those of this machine, which are not told apart.
    pub connections_per_address: usize,
    /// Streams at once over all connections, of which the daemon's own limit counts each as well: so pages can never take
    /// all places from controllers.
    pub streams: usize,
    /// Streams that one answer may carry.
    pub streams_per_answer: usize,
    /// A connection whose request head is not there by then is closed, an idle one too.
    pub head: Duration,
    /// A request body that is not there by then is refused.
    pub body: Duration,
    /// Largest request head, in bytes.
    pub head_bytes: usize,
    /// Largest request body, in bytes: a request is a few names and numbers.
    pub body_bytes: usize,
    /// Largest body of a request that carries a model set, in bytes.
    pub models_bytes: usize,
    /// Bodies above [`Limits::body_bytes`] at once; while one is read a further one is refused.
    pub large_bodies: usize,
    /// An answer of more bytes than this is large and takes a place until it is out. The layout of a forearm, which the page
    /// asks for when it opens, takes 60 KB and so needs none; all connections together hold 16 MiB of smaller ones.
    pub large_answer_bytes: usize,
    /// Large answers at once that are on their way. A further one takes the place of the oldest that has had
    /// [`Limits::large_answer`], whose connection is cut, and is refused while none has. The services count one until it is
    /// made and no longer, but its reader may take hours over it. Only loopback is served, which is one peer: there is no
    /// share of each.
    pub large_answers: usize,
    /// A large answer keeps its place for so long whoever else asks. A forearm's exported set takes 1 MB, the largest 16.
    pub large_answer: Duration,
    /// A connection whose peer takes nothing of what is to be written for so long is closed.
    pub unread: Duration,
    /// A stream that has nothing to tell sends an empty comment this often, so that a peer that is gone is found.
    pub comment: Duration,
    /// Bytes of answers that the kernel may hold for one connection. A peer that does not read finds this much of old
    /// values before the newest.
    pub send_buffer_bytes: u32,
    /// What is still open so long after the shutdown began is cut.
    pub drain: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            connections: 64,
            connections_per_address: 48,
            streams: 32,
            streams_per_answer: 8,
            head: Duration::from_secs(10),
            body: Duration::from_secs(10),
            head_bytes: 16 << 10,
            body_bytes: 64 << 10,
            models_bytes: 17 << 20, // 16 MiB of MODELS.json, its quotes and line ends escaped
            large_bodies: 1,
            large_answer_bytes: 256 << 10,
            large_answers: 8,
            large_answer: Duration::from_secs(20),
            unread: Duration::from_secs(5),
            comment: Duration::from_secs(5),
            send_buffer_bytes: 128 << 10,
            drain: Duration::from_secs(1),
        }
    }
}
