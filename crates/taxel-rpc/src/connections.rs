//! All connections, and the one watch over them: it ends those that hold a place and do nothing.
//!
//! Nobody else notices them. A peer that never sends its HTTP/2 preface lives for ever in tonic. A reader that answers pings,
//! reads its socket and gives no HTTP/2 window looks alive to TCP and to the keepalive, while its stream holds a place.
//! Idle connections may live as long as there is room: when there is none, the longest idle one is closed for the new one.
//!
//! A connection is ended by shutting its socket down, which whoever reads or writes it learns at once.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::IpAddr;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime};

use nix::sys::socket::{Shutdown, shutdown};
use tokio::time::MissedTickBehavior;

use crate::access::origin::peer_at;
use crate::limits::Limits;
use crate::refusals::Refusals;

/// All connections of one server. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Connections(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    open: Mutex<Open>,
    limits: Limits,
    refusals: Arc<Refusals>,
}

#[derive(Debug, Default)]
struct Open {
    arrived: u64,
    /// By the order in which they arrived.
    entries: BTreeMap<u64, Entry>,
}

/// One connection, as the watch sees it.
#[derive(Debug)]
struct Entry {
    peer: String,
    seat: Arc<Seat>,
    /// A copy of its descriptor.
    socket: OwnedFd,
    /// Its progress at the last look, and how many looks ago that began to be all.
    progress: u64,
    looks: u32,
}

/// What a connection does.
#[derive(Debug)]
pub struct Seat(Mutex<Activity>);

#[derive(Debug)]
struct Activity {
    /// Whether the peer speaks the protocol.
    proven: bool,
    /// Calls under way, until the last byte of their answers is out.
    calls: usize,
    /// Calls of which something is to be taken.
    waiting: usize,
    /// Grows with each sign of life.
    progress: u64,
    idle_since: Instant,
    /// A connection does not outlive the certificate that it was opened with.
    expires: Option<SystemTime>,
}

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub struct Ticket {
    number: u64,
    seat: Arc<Seat>,
    connections: Connections,
}

impl Connections {
    /// None yet.
    pub(crate) fn new(limits: Limits, refusals: Arc<Refusals>) -> Self {
        Self(Arc::new(Inner { open: Mutex::default(), limits, refusals }))
    }

    /// For a listener of its own.
    #[must_use]
    pub fn with_limits(limits: Limits) -> Self {
        Self::new(limits, Arc::default())
    }

    /// A place for a connection of this peer. If there is none, the longest idle connection is closed for it: one of the
    /// peer's own if it has all that one may have, first those that have proven nothing. `None` if none is idle.
    pub(crate) fn arrive(&self, socket: OwnedFd, peer: &str) -> Option<Ticket> {
        let limits = &self.0.limits;
        let mut open = self.open();
        let of_peer = open.entries.values().filter(|entry| entry.peer == peer).count();
        let own = of_peer >= limits.connections_per_peer;
        if own || open.entries.len() >= limits.connections {
            let candidates = open.entries.iter().filter(|(_, entry)| !own || entry.peer == peer);
            let idle = candidates.filter_map(|(number, entry)| Some((entry.seat.idle()?, *number)));
            let Some((_, number)) = idle.min() else {
                drop(open);
                let most = if own { limits.connections_per_peer } else { limits.connections };
                self.0.refusals.tell(("connection", peer), || {
                    format!("a connection of {peer} was refused: {most} have calls under way, which is the limit")
                });
                return None;
            };
            open.entries.remove(&number).iter().for_each(Entry::end);
        }
        open.arrived += 1;
        let (number, seat) = (open.arrived, Arc::new(Seat::new()));
        open.entries
            .insert(number, Entry { peer: peer.to_owned(), seat: Arc::clone(&seat), socket, progress: 0, looks: 0 });
        Some(Ticket { number, seat, connections: self.clone() })
    }

    /// The same for a connection from this address.
    pub fn admit(&self, socket: &impl AsFd, address: IpAddr) -> Option<Ticket> {
        self.arrive(socket.as_fd().try_clone_to_owned().ok()?, &peer_at(address))
    }

    /// Watches for ever.
    pub async fn keep(&self) -> Infallible {
        let mut looks = tokio::time::interval(self.0.limits.look);
        // What this process did not look at while it stood still is nobody's fault: looks are counted, and not the time.
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            looks.tick().await;
            self.look(SystemTime::now());
        }
    }

    fn look(&self, now: SystemTime) {
        let Inner { limits, refusals, .. } = &*self.0;
        let mut ended = Vec::new();
        for entry in self.open().entries.values_mut() {
            let activity = entry.seat.activity();
            let (proven, waits) = (activity.proven, !activity.proven || activity.waiting > 0);
            let expired = activity.expires.is_some_and(|expires| expires <= now);
            entry.looks = if waits && activity.progress == entry.progress { entry.looks + 1 } else { 0 };
            entry.progress = activity.progress;
            drop(activity);
            let most = if proven { limits.untaken_looks } else { limits.preface_looks };
            if expired || entry.looks > most {
                entry.end();
                entry.looks = 0;
                ended.push((entry.peer.clone(), proven, expired));
            }
        }
        for (peer, proven, expired) in ended {
            let why = match (proven, expired) {
                (_, true) => "its certificate has expired",
                (true, _) => "for too long it took nothing of an answer",
                (false, _) => "it sent no request in time",
            };
            refusals.tell(("ended", &peer), || format!("a connection of {peer} was closed: {why}"));
        }
    }

    /// Closes all of them.
    pub(crate) fn end_all(&self) {
        self.open().entries.values().for_each(Entry::end);
    }

    fn open(&self) -> MutexGuard<'_, Open> {
        self.0.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    fn end(&self) {
        let _ = shutdown(self.socket.as_raw_fd(), Shutdown::Both); // the peer may have closed it
    }
}

impl Ticket {
    /// What the connection does.
    #[must_use]
    pub fn seat(&self) -> Arc<Seat> {
        Arc::clone(&self.seat)
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.connections.open().entries.remove(&self.number);
    }
}

impl Seat {
    fn new() -> Self {
        let (proven, calls, waiting, progress) = (false, 0, 0, 0);
        Self(Mutex::new(Activity { proven, calls, waiting, progress, idle_since: Instant::now(), expires: None }))
    }

    fn activity(&self) -> MutexGuard<'_, Activity> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it is proven and since when it has no call; `None` while it has one.
    fn idle(&self) -> Option<(bool, Instant)> {
        let activity = self.activity();
        (activity.calls == 0).then_some((activity.proven, activity.idle_since))
    }

    fn sign(&self, change: impl FnOnce(&mut Activity)) {
        let mut activity = self.activity();
        activity.progress += 1;
        change(&mut activity);
    }

    /// The peer has shown that it speaks the protocol.
    pub(crate) fn prove(&self) {
        self.sign(|activity| activity.proven = true);
    }

    pub(crate) fn expire_at(&self, time: SystemTime) {
        self.activity().expires = Some(time);
    }

    /// A call is under way until this is dropped.
    #[must_use]
    pub fn begin(self: &Arc<Self>) -> Call {
        self.sign(|activity| (activity.proven, activity.calls) = (true, activity.calls + 1));
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
        self.seat.sign(|activity| activity.waiting = activity.waiting + usize::from(waits) - usize::from(self.waits));
        self.waits = waits;
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        self.waits(false);
        self.seat.sign(|activity| {
            activity.calls -= 1;
            activity.idle_since = Instant::now();
        });
    }
}
