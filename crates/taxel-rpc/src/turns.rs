//! Tells the subscribers of a patch one after the other, in the order in which they came, that there is a new snapshot.
//!
//! Waking all of them at once would make all messages before the first is written. In turn, the first message is on its
//! way, and its reader is woken on another processor, while the next ones are made. Each takes the snapshot itself when it has
//! its turn, so that it sends what is newest then.

use std::collections::BTreeMap;
use std::future::poll_fn;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::Duration;

use taxel_engine::snapshot::PatchSnapshot;
use tokio::sync::watch;
use tokio::time::Instant;

/// Whoever has had no turn by then is woken together with all others: between two turns everything else has its own that is
/// ready, so that a round would take long beside many calls.
const ROUND_MAX: Duration = Duration::from_micros(500);

/// Those who wait for snapshots, by the position of their patch in the plan. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Turns(Arc<[Patch]>);

/// The subscribers of one patch; `None` when nobody tells them anything any more.
#[derive(Debug)]
struct Patch(Mutex<Option<Subscribers>>);

/// By their number, which grows with each that comes.
#[derive(Debug, Default)]
struct Subscribers {
    all: BTreeMap<u64, watch::Sender<()>>,
    next: u64,
}

impl Turns {
    /// Begins to tell of what is published of each of the `patches`, of what is about to be, and everybody when `again` changes.
    /// Publishing wakes one task a patch, however many subscribers there are.
    pub(crate) fn begin(
        patches: impl Iterator<Item = (watch::Receiver<Arc<PatchSnapshot>>, watch::Receiver<()>)>,
        again: &watch::Receiver<()>,
    ) -> Self {
        let patches: Vec<_> = patches.collect();
        let turns = Self(patches.iter().map(|_| Patch(Mutex::new(Some(Subscribers::default())))).collect());
        for (position, (published, soon)) in patches.into_iter().enumerate() {
            let keeper = Keeper { turns: turns.clone(), position };
            tokio::spawn(keeper.keep(published, soon, again.clone()));
        }
        turns
    }

    /// A new subscriber of this patch: changes with each turn, and ends when the engine or the server has stopped.
    pub(crate) fn join(&self, position: usize) -> watch::Receiver<()> {
        let (sender, receiver) = watch::channel(());
        if let Some(subscribers) = &mut *self.0[position].subscribers() {
            subscribers.forget_the_gone();
            subscribers.all.insert(subscribers.next, sender);
            subscribers.next += 1;
        }
        receiver
    }
}

/// Tells the subscribers of one patch. However it ends, none of them waits for it any more.
struct Keeper {
    turns: Turns,
    position: usize,
}

impl Keeper {
    async fn keep(
        self,
        mut published: watch::Receiver<Arc<PatchSnapshot>>,
        mut soon: watch::Receiver<()>,
        mut again: watch::Receiver<()>,
    ) {
        let patch = self.patch();
        loop {
            tokio::select! {
                changed = published.changed() => if changed.is_err() { return },
                Ok(()) = soon.changed() => {
                    patch.tell_first(patch.begin()); // nearly all of the way is the same for each of them
                    continue;
                }
                Ok(()) = again.changed() => {}
            }
            let (mut left, begun) = (patch.begin(), Instant::now());
            while let Some(told) = patch.tell_first(left.clone()) {
                left.start = told + 1;
                if begun.elapsed() > ROUND_MAX {
                    patch.tell_all(left);
                    break;
                }
                give_way().await;
            }
        }
    }

    fn patch(&self) -> &Patch {
        &self.turns.0[self.position]
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        *self.patch().subscribers() = None;
    }
}

impl Patch {
    fn subscribers(&self) -> MutexGuard<'_, Option<Subscribers>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Who takes part in the round that begins: whoever comes later takes what is newest by itself.
    fn begin(&self) -> Range<u64> {
        let mut subscribers = self.subscribers();
        let Some(subscribers) = &mut *subscribers else { return 0..0 };
        subscribers.forget_the_gone();
        0..subscribers.next
    }

    /// Wakes the first of these that is still there; its number.
    fn tell_first(&self, numbers: Range<u64>) -> Option<u64> {
        let subscribers = self.subscribers();
        let (number, subscriber) = subscribers.as_ref()?.all.range(numbers).next()?;
        subscriber.send_replace(());
        Some(*number)
    }

    fn tell_all(&self, numbers: Range<u64>) {
        if let Some(subscribers) = &*self.subscribers() {
            for (_, subscriber) in subscribers.all.range(numbers) {
                subscriber.send_replace(());
            }
        }
    }
}

impl Subscribers {
    fn forget_the_gone(&mut self) {
        self.all.retain(|_, subscriber| !subscriber.is_closed());
    }
}

/// Lets the tasks go first that are ready now. tokio's own `yield_now` also asks the system for events each time.
async fn give_way() {
    let mut given = false;
    poll_fn(|cx| {
        if std::mem::replace(&mut given, true) {
            return Poll::Ready(());
        }
        cx.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
}

#[cfg(test)]
mod tests;
