//! The limits of the service: how much one peer may take, and what is kept for operators.
//!
//! A peer is an account on the Unix socket, a certificate, the holder of a token, or an address: all who come over loopback
//! TCP without a token are one.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::rules::Caller;
use crate::access::table::What;

/// Calls at once that take tens of milliseconds or megabytes: imports, exports, proposals.
const LONG_CALLS: usize = 8;

/// Of these, those that only operators can have.
const LONG_CALLS_RESERVED: usize = 2;

/// A connection is closed that takes nothing of its answers for so many checks, though something waits for it.
pub(crate) const UNTAKEN_CHECKS: u32 = 10;

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
    /// Long calls at once of one peer.
    pub long_calls_per_peer: usize,
    /// All connections are checked this often.
    pub check_every: Duration,
    /// A connection that has not sent the HTTP/2 preface after so many checks is closed. An honest client sends it at once.
    pub preface_checks: u32,
    /// A stream that pushes no scan for so long ends, and another may begin.
    pub push_pause: Duration,
    /// How long a command may take. A tare watches the skin for up to a minute, as it is configured.
    pub command: Duration,
    /// A ping goes out after so long a silence of the peer.
    pub keepalive_interval: Duration,
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
            long_calls_per_peer: 4,
            check_every: Duration::from_secs(1),
            preface_checks: 5,
            push_pause: Duration::from_secs(10),
            command: Duration::from_secs(90),
            keepalive_interval: Duration::from_secs(10),
            drain: Duration::from_secs(2),
        }
    }
}

/// Who has how much.
#[derive(Debug)]
pub(crate) struct Shares {
    limits: Limits,
    /// Places as long as somebody holds them.
    taken: Mutex<Vec<Weak<Place>>>,
}

/// A place that is taken until it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    what: What,
    /// Which peer has it.
    key: String,
}

impl Place {
    /// Whether it is that of a long call.
    pub(crate) fn is_long(&self) -> bool {
        self.what == What::LongCall
    }
}

impl Shares {
    pub(crate) fn new(limits: Limits) -> Self {
        Self { limits, taken: Mutex::default() }
    }

    fn taken(&self) -> MutexGuard<'_, Vec<Weak<Place>>> {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|place| place.strong_count() > 0);
        taken
    }

    /// A place for one more of this caller's. It is free again when it is dropped.
    pub(crate) fn place(&self, what: What, caller: &Caller) -> Result<Arc<Place>, Status> {
        let limits = &self.limits;
        let (name, all, peer, reserved) = match what {
            What::LongCall => ("long call", LONG_CALLS, limits.long_calls_per_peer, LONG_CALLS_RESERVED),
            What::Stream => ("stream", limits.streams, limits.streams_per_peer, limits.streams_reserved),
        };
        let reserved = reserved.min(all / 2); // where there are few places at all, observers have half of them
        let key = caller.key();
        let mut taken = self.taken();
        let of_kind = of_kind(&taken, what);
        let why = if of_kind.len() >= all {
            format!("{all} {name}s are being served, which is the limit")
        } else if of_kind.iter().filter(|place| place.key == key).count() >= peer {
            format!("{peer} {name}s of {key} are being served, which is the limit for one")
        } else if !caller.is_operator() && of_kind.len() >= all - reserved {
            format!("the last {reserved} {name}s are kept for operators")
        } else {
            let place = Arc::new(Place { what, key });
            taken.push(Arc::downgrade(&place));
            return Ok(place);
        };
        Err(Refusal::exhausted(ErrorReason::DaemonBusy, format!("{why}: end another first")).into())
    }

    /// Streams that are being served now.
    pub(crate) fn streams_open(&self) -> usize {
        of_kind(&self.taken(), What::Stream).len()
    }
}

fn of_kind(taken: &[Weak<Place>], what: What) -> Vec<Arc<Place>> {
    taken.iter().filter_map(Weak::upgrade).filter(|place| place.what == what).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::origin::Origin;
    use crate::access::table::Role;

    #[test]
    fn one_peer_leaves_places_for_others_and_all_observers_leave_some_for_operators() {
        let limits = Limits { streams: 10, streams_per_peer: 6, streams_reserved: 2, ..Limits::default() };
        let shares = Shares::new(limits);
        let origin = Arc::new(Origin::of_tcp(([127, 0, 0, 1], 4000).into()));
        let take = |name: &str, role| {
            let caller = Caller {
                origin: Arc::clone(&origin),
                name: Some(name.into()),
                by_token: true,
                role: Some(role),
                said: String::new(),
            };
            shares.place(What::Stream, &caller).map_err(|status| status.message().to_owned())
        };
        let mut held: Vec<_> = (0..6).map(|_| take("a", Role::Operator).unwrap()).collect();
        assert!(take("a", Role::Operator).unwrap_err().contains("6 streams of token a are being served"));
        held.extend((0..2).map(|_| take("b", Role::Observer).unwrap()));
        assert!(take("c", Role::Observer).unwrap_err().contains("the last 2 streams are kept for operators"));
        held.extend((0..2).map(|_| take("c", Role::Operator).unwrap()));
        assert!(take("d", Role::Admin).unwrap_err().contains("10 streams are being served"));
        drop(held);
        assert!(shares.taken().is_empty());
    }
}
