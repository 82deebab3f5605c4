//! How much of the service one peer may take, and what is kept for operators.
//!
//! A peer is an account on the Unix socket, a certificate, the holder of a token, or an address: all who come over loopback
//! TCP without a token are one.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::caller::Caller;
use crate::access::origin::PeerKey;
use crate::limits::Limits;

/// What a call takes a place of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    /// A call that is answered from what is known.
    Call,
    /// A call that takes tens of milliseconds, or megabytes.
    LongCall,
    /// A stream.
    Stream,
}

impl What {
    /// Its name, in the singular.
    const fn name(self) -> &'static str {
        match self {
            Self::Call => "call",
            Self::LongCall => "long call",
            Self::Stream => "stream",
        }
    }
}

/// Places of one sort.
#[derive(Debug)]
pub(crate) struct Pool {
    /// In all, for one peer, and of all for operators alone.
    most: [usize; 3],
    taken: usize,
    by_peer: HashMap<PeerKey, usize>,
}

impl Pool {
    fn new(all: usize, peer: usize, reserved: usize) -> Self {
        // Where there are few places at all, observers have half of them.
        Self { most: [all, peer, reserved.min(all / 2)], taken: 0, by_peer: HashMap::new() }
    }

    /// Takes one, or tells why there is none.
    fn take(&mut self, name: &str, key: &PeerKey, operator: bool) -> Result<(), String> {
        let [all, peer, reserved] = self.most;
        let of_peer = self.by_peer.get(key).copied().unwrap_or_default();
        let why = if self.taken >= all {
            format!("{all} {name}s are being served, which is the limit")
        } else if of_peer >= peer {
            format!("{peer} {name}s of {key} are being served, which is the limit for one")
        } else if !operator && self.taken >= all - reserved {
            format!("the last {reserved} {name}s are kept for operators")
        } else {
            self.taken += 1;
            self.by_peer.insert(key.clone(), of_peer + 1);
            return Ok(());
        };
        Err(format!("{why}: end another first"))
    }

    fn free(&mut self, key: &PeerKey) {
        self.taken -= 1;
        if let Some(taken) = self.by_peer.get_mut(key) {
            *taken -= 1;
            if *taken == 0 {
                self.by_peer.remove(key);
            }
        }
    }
}

/// Who has how much: a pool for each of [`What`].
#[derive(Debug)]
pub(crate) struct Shares(Mutex<[Pool; 3]>);

impl Shares {
    pub(crate) fn new(limits: &Limits) -> Arc<Self> {
        Arc::new(Self(Mutex::new([
            Pool::new(limits.calls, limits.calls_per_peer, limits.calls_reserved),
            Pool::new(limits.long_calls, limits.long_calls_per_peer, limits.long_calls_reserved),
            Pool::new(limits.streams, limits.streams_per_peer, limits.streams_reserved),
        ])))
    }

    fn pools(&self) -> MutexGuard<'_, [Pool; 3]> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for one more of this caller's. It is free again when it is dropped.
    pub(crate) fn place(self: &Arc<Self>, what: What, caller: &Caller) -> Result<Place, Status> {
        let key = caller.key();
        let taken = self.pools()[what as usize].take(what.name(), &key, caller.is_operator());
        taken.map_err(|why| Refusal::exhausted(ErrorReason::NoPlace, why))?;
        Ok(Place { shares: Arc::clone(self), what, key })
    }

    /// Streams that are being served now.
    pub(crate) fn streams_open(&self) -> usize {
        self.pools()[What::Stream as usize].taken
    }
}

/// A place that is taken until this is dropped.
pub(crate) struct Place {
    shares: Arc<Shares>,
    what: What,
    key: PeerKey,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.shares.pools()[self.what as usize].free(&self.key);
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a place of {}", self.key)
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
        let shares = Shares::new(&limits);
        let origin = Arc::new(Origin::of_tcp(([127, 0, 0, 1], 4000).into()));
        let take = |name: &str, role| {
            let caller =
                Caller { origin: Arc::clone(&origin), name: Some(name.into()), by_token: true, role: Some(role) };
            shares.place(What::Stream, &caller).map_err(|status| status.message().to_owned())
        };
        let mut held: Vec<_> = (0..6).map(|_| take("a", Role::Operator).unwrap()).collect();
        assert!(take("a", Role::Operator).unwrap_err().contains("6 streams of token a are being served"));
        held.extend((0..2).map(|_| take("b", Role::Observer).unwrap()));
        assert!(take("c", Role::Observer).unwrap_err().contains("the last 2 streams are kept for operators"));
        held.extend((0..2).map(|_| take("c", Role::Operator).unwrap()));
        assert!(take("d", Role::Admin).unwrap_err().contains("10 streams are being served"));
        drop(held);
        let pools = shares.pools();
        assert!(pools[2].by_peer.is_empty() && pools[2].taken == 0);
    }
}
