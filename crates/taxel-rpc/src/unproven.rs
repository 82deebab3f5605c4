//! Connections of which nothing is known yet: they are let in, but only so many, and the longest waiting one of whoever
//! has the most goes first. So thousands of idle sockets keep no client out: an honest one speaks at once.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};

use crate::access::origin::PeerKey;

#[derive(Debug)]
struct Entry {
    number: u64,
    key: PeerKey,
    evict: CancellationToken,
}

#[derive(Debug, Default)]
struct State {
    /// Oldest first.
    entries: Vec<Entry>,
    arrived: u64,
}

/// All of them. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Unproven {
    state: Arc<Mutex<State>>,
    most: usize,
}

impl Unproven {
    pub(crate) fn new(most: usize) -> Self {
        Self { state: Arc::default(), most: most.max(1) }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One more; another one may have to go for it.
    pub(crate) fn arrive(&self, key: PeerKey) -> Ticket {
        let mut state = self.state();
        if state.entries.len() >= self.most {
            let oldest = state.oldest_of_the_largest();
            state.entries.remove(oldest).evict.cancel();
        }
        state.arrived += 1;
        let (number, evict) = (state.arrived, CancellationToken::new());
        state.entries.push(Entry { number, key, evict: evict.clone() });
        Ticket { number, all: self.clone(), evicted: Box::pin(evict.cancelled_owned()) }
    }
}

impl State {
    /// Position of the oldest of the peer that has the most.
    fn oldest_of_the_largest(&self) -> usize {
        let of = |key: &PeerKey| self.entries.iter().filter(|entry| entry.key == *key).count();
        // The last of equals in reverse order is the oldest.
        let largest = self.entries.iter().enumerate().rev().max_by_key(|(_, entry)| of(&entry.key));
        largest.map_or(0, |(position, _)| position)
    }
}

/// A connection's place among them, until it is dropped.
pub(crate) struct Ticket {
    number: u64,
    all: Unproven,
    evicted: Pin<Box<WaitForCancellationFutureOwned>>,
}

impl Ticket {
    /// Ready when the connection has to go.
    pub(crate) fn poll_evicted(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        self.evicted.as_mut().poll(cx)
    }

    /// Returns when the connection has to go.
    #[cfg(feature = "tls")]
    pub(crate) async fn evicted(&mut self) {
        self.evicted.as_mut().await;
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.all.state().entries.retain(|entry| entry.number != self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::task::Waker;

    fn is_evicted(ticket: &mut Ticket) -> bool {
        ticket.poll_evicted(&mut Context::from_waker(Waker::noop())).is_ready()
    }

    #[test]
    fn a_crowd_evicts_its_own_oldest_and_nobody_elses() {
        let unproven = Unproven::new(4);
        let mut honest = unproven.arrive(PeerKey::User(1));
        let mut crowd: Vec<Ticket> = (0..100).map(|_| unproven.arrive(PeerKey::User(2))).collect();
        assert!(!is_evicted(&mut honest));
        let evicted: Vec<bool> = crowd.iter_mut().map(is_evicted).collect();
        assert!(evicted[..97].iter().all(|gone| *gone) && evicted[97..].iter().all(|gone| !gone), "{evicted:?}");
        drop((honest, crowd));
        assert!(unproven.state().entries.is_empty());
    }

    #[test]
    fn of_one_peer_the_oldest_goes() {
        let unproven = Unproven::new(2);
        let mut tickets: Vec<Ticket> = (0..3).map(|_| unproven.arrive(PeerKey::User(1))).collect();
        let evicted: Vec<bool> = tickets.iter_mut().map(is_evicted).collect();
        assert_eq!(evicted, [true, false, false]);
    }
}
