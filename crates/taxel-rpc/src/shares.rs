//! How much of the service one peer may take, and what is kept for operators.
//!
//! A peer is an account on the Unix socket, a certificate, the holder of a token, or an address: all who come over loopback
//! TCP without a token are one.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::caller::Caller;
use crate::limits::Limits;

/// What a call takes a place of. One that is answered from what is known takes none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    /// A call that takes tens of milliseconds, or megabytes.
    LongCall,
    /// A stream.
    Stream,
}

/// Who has how much.
#[derive(Debug)]
pub(crate) struct Shares {
    limits: Limits,
    /// Places that are taken, and by which peer.
    taken: Mutex<Vec<(What, String)>>,
}

impl Shares {
    pub(crate) fn new(limits: Limits) -> Arc<Self> {
        Arc::new(Self { limits, taken: Mutex::default() })
    }

    fn taken(&self) -> MutexGuard<'_, Vec<(What, String)>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for one more of this caller's. It is free again when it is dropped.
    pub(crate) fn place(self: &Arc<Self>, what: What, caller: &Caller) -> Result<Place, Status> {
        let limits = &self.limits;
        let (name, all, peer, reserved) = match what {
            What::LongCall => ("long call", limits.long_calls, limits.long_calls_per_peer, limits.long_calls_reserved),
            What::Stream => ("stream", limits.streams, limits.streams_per_peer, limits.streams_reserved),
        };
        let reserved = reserved.min(all / 2); // where there are few places at all, observers have half of them
        let key = caller.key();
        let mut taken = self.taken();
        let of_peer = taken.iter().filter(|(of, by)| *of == what && *by == key).count();
        let in_all = taken.iter().filter(|(of, _)| *of == what).count();
        let why = if in_all >= all {
            format!("{all} {name}s are being served, which is the limit")
        } else if of_peer >= peer {
            format!("{peer} {name}s of {key} are being served, which is the limit for one")
        } else if !caller.is_operator() && in_all >= all - reserved {
            format!("the last {reserved} {name}s are kept for operators")
        } else {
            taken.push((what, key.clone()));
            return Ok(Place { shares: Arc::clone(self), what, key });
        };
        Err(Refusal::exhausted(ErrorReason::NoPlace, format!("{why}: end another first")).into())
    }

    /// Streams that are being served now.
    pub(crate) fn streams_open(&self) -> usize {
        self.taken().iter().filter(|(of, _)| *of == What::Stream).count()
    }
}

/// A place that is taken until this is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    shares: Arc<Shares>,
    what: What,
    key: String,
}

/// The place of a call, if it has one, for work and answers that outlive it.
pub(crate) type Held = Option<Arc<Place>>;

impl Drop for Place {
    fn drop(&mut self) {
        let mut taken = self.shares.taken();
        if let Some(position) = taken.iter().position(|(of, by)| *of == self.what && *by == self.key) {
            taken.swap_remove(position);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::origin::Origin;
    use crate::access::role::Role;

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

    #[test]
    fn a_peer_that_has_all_its_streams_has_connections_left() {
        let limits = Limits::default();
        let busy = limits.streams_per_peer + limits.long_calls_per_peer;
        assert!(busy < limits.connections_per_peer && limits.connections_per_peer < limits.connections);
    }
}
