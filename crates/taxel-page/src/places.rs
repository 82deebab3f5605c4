//! Places of connections: one that waits for its peer makes room for a new one, so that no number of idle sockets keeps
//! anybody out.

use std::net::IpAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};

use hyper::body::{Body, Bytes, Frame, SizeHint};
use tokio_util::sync::CancellationToken;

/// All places. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Places {
    state: Arc<Mutex<State>>,
    most: usize,
    per_address: usize,
}

#[derive(Debug, Default)]
struct State {
    /// Oldest first.
    entries: Vec<Entry>,
    arrived: u64,
}

#[derive(Debug)]
struct Entry {
    number: u64,
    address: IpAddr,
    /// For its peer: a request is not there, or not whole.
    waits: bool,
    evict: CancellationToken,
}

/// All places of which one could be had are taken by connections that are being served: so many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoPlace(pub(crate) usize);

impl Places {
    /// So many in all and for one address. Those of this machine are not told apart.
    pub(crate) fn new(most: usize, per_address: usize) -> Self {
        Self { state: Arc::default(), most, per_address }
    }

    /// A place for one more. If there is none, the longest waiting connection of the address that has the most goes; of an
    /// address that has its share, one of its own.
    pub(crate) fn arrive(&self, address: IpAddr) -> Result<Arc<Place>, NoPlace> {
        let mut state = self.state();
        let address = address.to_canonical();
        if !address.is_loopback() && state.of(address) >= self.per_address {
            state.evict(|entry| entry.address == address).ok_or(NoPlace(self.per_address))?;
        } else if state.entries.len() >= self.most {
            state.evict(|_| true).ok_or(NoPlace(self.most))?;
        }
        state.arrived += 1;
        let (number, evict) = (state.arrived, CancellationToken::new());
        state.entries.push(Entry { number, address, waits: true, evict: evict.clone() });
        Ok(Arc::new(Place { number, places: self.clone(), evict }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn of(&self, address: IpAddr) -> usize {
        self.entries.iter().filter(|entry| entry.address == address).count()
    }

    /// One of those that wait goes, if there is one among `those`.
    fn evict(&mut self, those: impl Fn(&Entry) -> bool) -> Option<()> {
        let waiting = self.entries.iter().enumerate().filter(|(_, entry)| entry.waits && those(entry));
        // The last of equals in reverse order is the oldest.
        let (position, _) = waiting.rev().max_by_key(|(_, entry)| self.of(entry.address))?;
        self.entries.remove(position).evict.cancel();
        Some(())
    }
}

/// A connection's place, until it is dropped.
#[derive(Debug)]
pub(crate) struct Place {
    number: u64,
    places: Places,
    evict: CancellationToken,
}

impl Place {
    /// Returns when the connection has to go.
    pub(crate) async fn evicted(&self) {
        self.evict.cancelled().await;
    }

    /// What makes the connection go.
    pub(crate) fn cut(&self) -> CancellationToken {
        self.evict.clone()
    }

    /// A request is there, whole; the connection stays until the answer is out.
    pub(crate) fn serve(&self) {
        self.set_waits(false);
    }

    fn set_waits(&self, waits: bool) {
        let mut state = self.places.state();
        if let Some(entry) = state.entries.iter_mut().find(|entry| entry.number == self.number) {
            entry.waits = waits;
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.state().entries.retain(|entry| entry.number != self.number);
    }
}

/// The body of an answer. When it is out, or given up, the connection waits again.
pub(crate) struct Served<B> {
    pub(crate) body: B,
    pub(crate) place: Arc<Place>,
}

impl<B: Body<Data = Bytes> + Unpin> Body for Served<B> {
    type Data = Bytes;
    type Error = B::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, B::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl<B> Drop for Served<B> {
    fn drop(&mut self) {
        self.place.set_waits(true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn address(last: u8) -> IpAddr {
        [192, 0, 2, last].into()
    }

    fn are_evicted(places: &[Arc<Place>]) -> Vec<bool> {
        places.iter().map(|place| place.evict.is_cancelled()).collect()
    }

    #[test]
    fn the_oldest_that_waits_makes_room_and_one_that_is_served_never() {
        let places = Places::new(3, 3);
        let held: Vec<_> = (0..3).map(|_| places.arrive(HERE).unwrap()).collect();
        held[0].serve();
        let fourth = places.arrive(HERE).unwrap();
        assert_eq!(are_evicted(&held), [false, true, false]);
        held[2].serve();
        fourth.serve();
        assert_eq!(places.arrive(HERE).unwrap_err(), NoPlace(3));
        drop(Served { body: http_body_util::Empty::<Bytes>::new(), place: Arc::clone(&held[0]) });
        let _fifth = places.arrive(HERE).unwrap();
        assert_eq!(are_evicted(&held), [true, true, false], "it waits again");
        drop((held, fourth));
    }

    #[test]
    fn an_address_has_its_share_and_a_crowd_evicts_its_own() {
        let places = Places::new(4, 3);
        let honest = places.arrive(address(1)).unwrap();
        let crowd: Vec<_> = (0..10).map(|_| places.arrive(address(2)).unwrap()).collect();
        assert_eq!(are_evicted(&crowd).iter().filter(|gone| !**gone).count(), 3);
        crowd.iter().for_each(|place| place.serve());
        assert_eq!(places.arrive(address(2)).unwrap_err(), NoPlace(3));
        let third = places.arrive(address(3)).unwrap();
        assert!(honest.evict.is_cancelled(), "nobody else waits");
        drop((crowd, third, honest));
        assert!(places.state().entries.is_empty());
    }
}
