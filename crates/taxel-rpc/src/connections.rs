//! All connections, and the one watch over them: it ends those that hold a place and do nothing.
//!
//! Nobody else notices them. A peer that never sends its HTTP/2 preface lives for ever in tonic. A reader that answers pings,
//! reads its socket and gives no HTTP/2 window looks alive to TCP and to the keepalive, while its stream holds a place.
//! Idle connections may live as long as there is room: when there is none, the longest idle one is closed for the new one.
//!
//! A connection is ended by shutting its socket down, which its reader and writer learn at once.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::IpAddr;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use nix::sys::socket::{Shutdown, shutdown};
use tokio::time::MissedTickBehavior;

use crate::access::origin::peer_at;
use crate::limits::{Limits, UNTAKEN_CHECKS};
use crate::refusals::Refusals;

/// All connections of one server. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Connections(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    /// By the order in which they arrived.
    open: Mutex<BTreeMap<u64, Entry>>,
    arrived: AtomicU64,
    limits: Limits,
    refusals: Arc<Refusals>,
}

/// One connection, as the watch sees it.
#[derive(Debug)]
struct Entry {
    peer: String,
    /// A copy of its descriptor.
    socket: OwnedFd,
    /// Whether the peer speaks the protocol.
    proven: bool,
    /// Calls under way, until the last byte of their answers is on its way.
    calls: usize,
    /// Calls of which something is to be taken.
    waiting: usize,
    idle_since: Instant,
    /// Checks since its last sign of life, while one is due.
    still_checks: u32,
}

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub struct Seat {
    number: u64,
    connections: Connections,
}

impl Connections {
    /// None yet.
    pub(crate) fn new(limits: Limits, refusals: Arc<Refusals>) -> Self {
        Self(Arc::new(Inner { open: Mutex::default(), arrived: AtomicU64::new(0), limits, refusals }))
    }

    /// For a listener of its own.
    #[must_use]
    pub fn with_limits(limits: Limits) -> Self {
        Self::new(limits, Arc::default())
    }

    /// A place for a connection of this peer. If there is none, the longest idle connection is closed for it: one of the
    /// peer's own if it has all that one may have, first those that have proven nothing. `None` if none is idle.
    pub(crate) fn arrive(&self, socket: OwnedFd, peer: &str) -> Option<Arc<Seat>> {
        let limits = &self.0.limits;
        let mut open = self.open();
        let of_peer = open.values().filter(|entry| entry.peer == peer).count();
        let own = of_peer >= limits.connections_per_peer;
        if own || open.len() >= limits.connections {
            let candidates = open.iter().filter(|(_, entry)| !own || entry.peer == peer);
            let idle = candidates.filter(|(_, entry)| entry.calls == 0);
            let idle = idle.map(|(number, entry)| (entry.proven, entry.idle_since, *number));
            let Some((.., number)) = idle.min() else {
                drop(open);
                let most = if own { limits.connections_per_peer } else { limits.connections };
                self.0.refusals.tell(("connection", peer), || {
                    format!("a connection of {peer} was refused: {most} have calls under way, which is the limit")
                });
                return None;
            };
            open.remove(&number).iter().for_each(Entry::end);
        }
        let number = self.0.arrived.fetch_add(1, Ordering::Relaxed);
        let (peer, idle_since) = (peer.to_owned(), Instant::now());
        let entry = Entry { peer, socket, proven: false, calls: 0, waiting: 0, idle_since, still_checks: 0 };
        open.insert(number, entry);
        Some(Arc::new(Seat { number, connections: self.clone() }))
    }

    /// The same for a connection from this address.
    pub fn admit(&self, socket: &impl AsFd, address: IpAddr) -> Option<Arc<Seat>> {
        self.arrive(socket.as_fd().try_clone_to_owned().ok()?, &peer_at(address))
    }

    /// Watches for ever.
    pub async fn keep(&self) -> Infallible {
        let mut checks = tokio::time::interval(self.0.limits.check_every);
        // What this process did not check while it stood still is nobody's fault: checks are counted, and not the time.
        checks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            checks.tick().await;
            self.check();
        }
    }

    fn check(&self) {
        let Inner { limits, refusals, .. } = &*self.0;
        for entry in self.open().values_mut() {
            let waits = !entry.proven || entry.waiting > 0;
            entry.still_checks = if waits { entry.still_checks + 1 } else { 0 };
            let most = if entry.proven { UNTAKEN_CHECKS } else { limits.preface_checks };
            if entry.still_checks > most {
                entry.end();
                entry.still_checks = 0;
                let (peer, untaken) = (&entry.peer, "for too long it took nothing of an answer");
                let why = if entry.proven { untaken } else { "it sent no request in time" };
                refusals.tell(("ended", peer), || format!("a connection of {peer} was closed: {why}"));
            }
        }
    }

    /// Closes all of them.
    pub(crate) fn end_all(&self) {
        self.open().values().for_each(Entry::end);
    }

    fn open(&self) -> MutexGuard<'_, BTreeMap<u64, Entry>> {
        self.0.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    fn end(&self) {
        let _ = shutdown(self.socket.as_raw_fd(), Shutdown::Both); // the peer may have closed it
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.connections.open().remove(&self.number);
    }
}

impl Seat {
    fn sign(&self, change: impl FnOnce(&mut Entry)) {
        if let Some(entry) = self.connections.open().get_mut(&self.number) {
            entry.still_checks = 0;
            change(entry);
        }
    }

    /// The peer has shown that it speaks the protocol.
    pub(crate) fn speaks_http2(&self) {
        self.sign(|entry| entry.proven = true);
    }

    /// A call is under way until this is dropped.
    #[must_use]
    pub fn begin(self: &Arc<Self>) -> Call {
        self.sign(|entry| (entry.proven, entry.calls) = (true, entry.calls + 1));
        Call { seat: Arc::clone(self), waits: false }
    }
}

/// A call under way.
#[derive(Debug)]
pub struct Call {
    seat: Arc<Seat>,
    /// Whether it is the peer's turn to take something.
    waits: bool,
}

impl Call {
    /// It is the peer's turn now, or not; either way the peer has done something.
    pub(crate) fn waits(&mut self, waits: bool) {
        self.seat.sign(|entry| entry.waiting = entry.waiting + usize::from(waits) - usize::from(self.waits));
        self.waits = waits;
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        self.waits(false);
        self.seat.sign(|entry| (entry.calls, entry.idle_since) = (entry.calls - 1, Instant::now()));
    }
}
