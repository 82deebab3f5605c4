//! How much of the service one peer may take, and what is kept for operators.
//!
//! A peer is an account on the Unix socket, a certificate, the holder of a token, or an address: all who come over loopback
//! TCP without a token are one.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use taxel_proto::refusal::Refusal;
use taxel_proto::v1::ErrorReason;
use tonic::Status;

use crate::access::caller::Caller;
use crate::access::origin::PeerKey;
use crate::limits::{Limits, Rate};

/// Peers whose rates are remembered at once. Beyond, those that have not called for longest are forgotten.
const PEERS_MAX: usize = 1024;

/// What places there are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum What {
    Connection,
    Stream,
    /// A stream whose request has not come whole yet.
    Opening,
    /// A call that does not stream, until its answer is out.
    Call,
    /// An answer that can be large, from before it is made.
    LargeAnswer,
    /// The samples of a stored session, in memory.
    Export,
}

impl What {
    /// So many of them, with the verb.
    fn are(self, number: usize, of: &str) -> String {
        let name = match self {
            Self::Connection => "connection",
            Self::Stream => "stream",
            Self::Opening => "request for a stream",
            Self::Call => "call",
            Self::LargeAnswer => "large answer",
            Self::Export => "reading of stored samples",
        };
        match (self, number) {
            (_, 1) => format!("1 {name}{of} is"),
            (Self::Opening, number) => format!("{number} requests for streams{of} are"),
            (Self::Export, number) => format!("{number} readings of stored samples{of} are"),
            (_, number) => format!("{number} {name}s{of} are"),
        }
    }
}

/// Places of one sort.
#[derive(Debug)]
struct Pool {
    /// In all, for one peer, and of all for operators alone.
    most: [usize; 3],
    taken: usize,
    by_peer: HashMap<PeerKey, usize>,
}

/// Why there is no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoPlace {
    /// All are taken; how many there are.
    All(usize),
    /// The peer has all that one may have.
    Peer(usize),
    /// What is left is for operators: so many.
    Reserved(usize),
}

impl NoPlace {
    /// What is refused and why, with what to do.
    pub(crate) fn text(self, what: What, peer: &PeerKey) -> String {
        let why = match self {
            Self::All(most) => format!("{} being served, which is the limit", what.are(most, "")),
            Self::Peer(most) => {
                format!("{} being served, which is the limit for one", what.are(most, &format!(" of {peer}")))
            }
            Self::Reserved(left) => format!("the last {} kept for operators", what.are(left, "")),
        };
        format!("{why}: end another first")
    }
}

impl Pool {
    fn new(all: usize, peer: usize, reserved: usize) -> Self {
        // Where there are few places at all, observers have half of them.
        Self { most: [all, peer, reserved.min(all / 2)], taken: 0, by_peer: HashMap::new() }
    }

    fn room(&self, key: &PeerKey, operator: bool) -> Result<(), NoPlace> {
        let [all, peer, reserved] = self.most;
        match self.taken {
            taken if taken >= all => Err(NoPlace::All(all)),
            _ if self.by_peer.get(key).is_some_and(|taken| *taken >= peer) => Err(NoPlace::Peer(peer)),
            taken if !operator && taken >= all - reserved => Err(NoPlace::Reserved(reserved)),
            _ => Ok(()),
        }
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

/// What a peer may still do of something that is bounded in time.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    left: f64,
    at: Instant,
}

/// Rates of one sort by peer.
#[derive(Debug)]
struct Rates {
    rate: Rate,
    by_peer: HashMap<PeerKey, Bucket>,
}

impl Rates {
    fn new(rate: Rate) -> Self {
        Self { rate, by_peer: HashMap::new() }
    }

    /// Takes one, or tells after how many seconds there is one.
    fn take(&mut self, key: &PeerKey, now: Instant) -> Result<(), f64> {
        if self.by_peer.len() >= PEERS_MAX && !self.by_peer.contains_key(key) {
            let oldest = self.by_peer.iter().min_by_key(|(_, bucket)| bucket.at).map(|(key, _)| key.clone());
            oldest.map(|oldest| self.by_peer.remove(&oldest));
        }
        let (burst, every_s) = (f64::from(self.rate.burst), self.rate.every.as_secs_f64());
        let bucket = self.by_peer.entry(key.clone()).or_insert(Bucket { left: burst, at: now });
        let waited = now.saturating_duration_since(bucket.at).as_secs_f64();
        bucket.left = (bucket.left + waited / every_s).min(burst);
        bucket.at = now;
        if bucket.left < 1.0 {
            return Err((1.0 - bucket.left) * every_s);
        }
        bucket.left -= 1.0;
        Ok(())
    }
}

#[derive(Debug)]
struct State {
    connections: Pool,
    streams: Pool,
    opening: Pool,
    calls: Pool,
    large_answers: Pool,
    exports: Pool,
    commands: Rates,
    session_starts: Rates,
}

impl State {
    fn pool(&mut self, what: What) -> &mut Pool {
        match what {
            What::Connection => &mut self.connections,
            What::Stream => &mut self.streams,
            What::Opening => &mut self.opening,
            What::Call => &mut self.calls,
            What::LargeAnswer => &mut self.large_answers,
            What::Export => &mut self.exports,
        }
    }
}

/// Who has how much.
#[derive(Debug)]
pub(crate) struct Shares(Mutex<State>);

impl Shares {
    pub(crate) fn new(limits: &Limits) -> Arc<Self> {
        Arc::new(Self(Mutex::new(State {
            connections: Pool::new(limits.connections, limits.connections_per_peer, limits.connections_reserved),
            streams: Pool::new(limits.streams, limits.streams_per_peer, limits.streams_reserved),
            opening: Pool::new(limits.opening, limits.opening_per_peer, limits.opening_reserved),
            calls: Pool::new(limits.calls, limits.calls_per_peer, limits.calls_reserved),
            large_answers: Pool::new(
                limits.large_answers,
                limits.large_answers_per_peer,
                limits.large_answers_reserved,
            ),
            exports: Pool::new(limits.exports, limits.exports_per_peer, limits.exports_reserved),
            commands: Rates::new(limits.commands),
            session_starts: Rates::new(limits.session_starts),
        })))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there is a place, without taking it.
    pub(crate) fn room(&self, what: What, key: &PeerKey, operator: bool) -> Result<(), NoPlace> {
        self.state().pool(what).room(key, operator)
    }

    /// Whether all places are taken, whoever asks.
    #[cfg(feature = "tls")]
    pub(crate) fn is_full(&self, what: What) -> bool {
        let mut state = self.state();
        let pool = state.pool(what);
        pool.taken >= pool.most[0]
    }

    pub(crate) fn take(self: &Arc<Self>, what: What, key: PeerKey, operator: bool) -> Result<Place, NoPlace> {
        let mut state = self.state();
        let pool = state.pool(what);
        pool.room(&key, operator)?;
        pool.taken += 1;
        *pool.by_peer.entry(key.clone()).or_default() += 1;
        Ok(Place { shares: Arc::clone(self), what, key })
    }

    /// A place for one more of this caller's. It is free again when it is dropped.
    pub(crate) fn place(self: &Arc<Self>, what: What, caller: &Caller) -> Result<Place, Status> {
        let key = caller.key();
        let refused = |why: NoPlace| Refusal::exhausted(ErrorReason::NoPlace, why.text(what, &key));
        Ok(self.take(what, key.clone(), caller.is_operator()).map_err(refused)?)
    }

    /// Streams that are being served now.
    pub(crate) fn streams_open(&self) -> usize {
        self.state().streams.taken
    }

    /// One more command of this caller.
    pub(crate) fn command(&self, caller: &Caller) -> Result<(), Status> {
        let key = caller.key();
        let mut state = self.state();
        let rate = state.commands.rate;
        let taken = state.commands.take(&key, Instant::now());
        taken.map_err(|wait| too_fast(&key, "commands", rate, wait))
    }

    /// One more session of this caller.
    pub(crate) fn session_start(&self, caller: &Caller) -> Result<(), Status> {
        self.command(caller)?;
        let key = caller.key();
        let mut state = self.state();
        let rate = state.session_starts.rate;
        let taken = state.session_starts.take(&key, Instant::now());
        taken.map_err(|wait| too_fast(&key, "sessions", rate, wait))
    }
}

fn too_fast(key: &PeerKey, what: &str, rate: Rate, wait_s: f64) -> Status {
    let (burst, every_s) = (rate.burst, rate.every.as_secs_f64());
    let tenths = (10.0 * wait_s).ceil() / 10.0; // never 0.0
    let text = format!(
        "{key} asked for more than {burst} {what} in a row, beyond which one every {every_s} s is taken: try again in \
         {tenths:.1} s"
    );
    // Rates are of the configuration, and a wait may be too long for a `Duration`.
    let wait = Duration::try_from_secs_f64(wait_s).unwrap_or(Duration::MAX);
    Refusal::exhausted(ErrorReason::TooOften, text).retry_after(wait).into()
}

/// A place that is taken until this is dropped.
pub(crate) struct Place {
    shares: Arc<Shares>,
    what: What,
    key: PeerKey,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.shares.state().pool(self.what).free(&self.key);
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
    use std::time::Duration;

    fn shares(all: usize, peer: usize, reserved: usize) -> Arc<Shares> {
        Shares::new(&Limits {
            connections: all,
            connections_per_peer: peer,
            connections_reserved: reserved,
            ..Limits::default()
        })
    }

    #[test]
    fn one_peer_leaves_places_for_others_and_all_observers_leave_some_for_operators() {
        let shares = shares(10, 6, 2);
        let take = |uid, operator| shares.take(What::Connection, PeerKey::User(uid), operator);
        let mut held: Vec<_> = (0..6).map(|_| take(1, true).unwrap()).collect();
        assert_eq!(take(1, true).unwrap_err(), NoPlace::Peer(6));
        held.extend((0..2).map(|_| take(2, false).unwrap()));
        assert_eq!(take(3, false).unwrap_err(), NoPlace::Reserved(2));
        held.extend((0..2).map(|_| take(3, true).unwrap()));
        assert_eq!(take(4, true).unwrap_err(), NoPlace::All(10));
        assert!(shares.is_full(What::Connection));
        drop(held);
        assert!(shares.state().connections.by_peer.is_empty());
        assert_eq!(shares.state().connections.taken, 0);
    }

    #[test]
    fn a_burst_is_taken_and_then_only_the_rate() {
        let mut rates = Rates::new(Rate { burst: 3, every: Duration::from_secs(2) });
        let (key, begun) = (PeerKey::User(1), Instant::now());
        for _ in 0..3 {
            rates.take(&key, begun).unwrap();
        }
        assert_eq!(rates.take(&key, begun), Err(2.0));
        assert_eq!(rates.take(&PeerKey::User(2), begun), Ok(()), "others have their own");
        assert_eq!(rates.take(&key, begun + Duration::from_secs(2)), Ok(()));
        assert_eq!(rates.take(&key, begun + Duration::from_secs(3)), Err(1.0));
        let later = begun + Duration::from_secs(1_000_000);
        assert_eq!(
            (0..10).filter(|_| rates.take(&key, later).is_ok()).count(),
            3,
            "nothing is saved up beyond a burst"
        );
    }

    #[test]
    fn rates_of_many_peers_take_bounded_room() {
        let mut rates = Rates::new(Rate { burst: 1, every: Duration::from_secs(1) });
        let begun = Instant::now();
        for uid in 0..10_000 {
            rates.take(&PeerKey::User(uid), begun + Duration::from_millis(uid.into())).unwrap();
        }
        assert_eq!(rates.by_peer.len(), PEERS_MAX);
    }
}
