//! Hands each new snapshot of a patch to its subscribers in turn, in the order in which they came.
//!
//! Waking all of them at once would make all messages before the first is written. In turn, the first message is on its
//! way, and its reader is woken on another processor, while the next ones are made.

use std::future::poll_fn;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;

use taxel_engine::snapshot::PatchSnapshot;
use tokio::sync::watch;

type Snapshots = watch::Receiver<Arc<PatchSnapshot>>;

/// Those who wait for snapshots, by the position of their patch in the plan. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Turns(Arc<[Patch]>);

#[derive(Debug)]
struct Patch {
    /// From the engine.
    newest: Snapshots,
    /// One a subscriber; `None` when the engine has stopped.
    subscribers: Mutex<Option<Vec<watch::Sender<Arc<PatchSnapshot>>>>>,
}

impl Turns {
    /// Begins to hand over what the engine publishes of each of the `patches`, and what is newest once more when `again`
    /// changes. Publishing wakes one task a patch, however many subscribers there are.
    pub(crate) fn begin(patches: impl Iterator<Item = Snapshots>, again: &watch::Receiver<()>) -> Self {
        let patch = |newest| Patch { newest, subscribers: Mutex::new(Some(Vec::new())) };
        let turns = Self(patches.map(patch).collect());
        for position in 0..turns.0.len() {
            tokio::spawn(turns.clone().keep(position, again.clone()));
        }
        turns
    }

    /// What a new subscriber of this patch waits with. It ends when the engine has stopped.
    pub(crate) fn join(&self, position: usize) -> Snapshots {
        let patch = &self.0[position];
        let (sender, receiver) = watch::channel(Arc::clone(&patch.newest.borrow()));
        if let Some(subscribers) = &mut *patch.subscribers() {
            subscribers.retain(|subscriber| !subscriber.is_closed());
            subscribers.push(sender);
        }
        receiver
    }

    async fn keep(self, position: usize, mut again: watch::Receiver<()>) {
        let patch = &self.0[position];
        let mut newest = patch.newest.clone();
        loop {
            tokio::select! {
                changed = newest.changed() => if changed.is_err() { break },
                Ok(()) = again.changed() => {}
            }
            newest.mark_unchanged();
            let mut turn = 0;
            while patch.wake(turn, &newest) {
                turn += 1;
                give_way().await;
            }
        }
        *patch.subscribers() = None;
    }
}

impl Patch {
    /// Hands the newest snapshot to the subscriber whose turn it is; false when all have had theirs.
    fn wake(&self, turn: usize, newest: &Snapshots) -> bool {
        let mut subscribers = self.subscribers();
        let Some(subscribers) = &mut *subscribers else { return false };
        while subscribers.get(turn).is_some_and(watch::Sender::is_closed) {
            subscribers.remove(turn);
        }
        let Some(subscriber) = subscribers.get(turn) else { return false };
        subscriber.send_replace(Arc::clone(&newest.borrow()));
        true
    }

    fn subscribers(&self) -> MutexGuard<'_, Option<Vec<watch::Sender<Arc<PatchSnapshot>>>>> {
        self.subscribers.lock().unwrap_or_else(PoisonError::into_inner)
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
mod tests {
    use super::*;
    use tokio::sync::mpsc;

    struct Scene {
        turns: Turns,
        engine: watch::Sender<Arc<PatchSnapshot>>,
        again: watch::Sender<()>,
    }

    /// One patch of which nothing has been published.
    fn scene() -> Scene {
        let (engine, again) = (watch::Sender::default(), watch::Sender::default());
        Scene { turns: Turns::begin([engine.subscribe()].into_iter(), &again.subscribe()), engine, again }
    }

    fn numbered(sequence: u64) -> Arc<PatchSnapshot> {
        Arc::new(PatchSnapshot { sequence, ..PatchSnapshot::default() })
    }

    async fn next(snapshots: &mut Snapshots) -> Option<u64> {
        snapshots.changed().await.ok()?;
        Some(snapshots.borrow_and_update().sequence)
    }

    /// A message is made where its subscriber is woken, and written by another task that it wakes.
    #[tokio::test]
    async fn a_message_is_written_before_the_next_one_is_made() {
        let Scene { turns, engine, .. } = scene();
        let (done, mut seen) = mpsc::unbounded_channel();
        for subscriber in 0..3 {
            let (to_write, mut made) = mpsc::unbounded_channel();
            let (mut snapshots, done_making) = (turns.join(0), done.clone());
            tokio::spawn(async move {
                while let Some(sequence) = next(&mut snapshots).await {
                    done_making.send(("made", subscriber, sequence)).unwrap();
                    to_write.send(sequence).unwrap();
                }
            });
            let done_writing = done.clone();
            tokio::spawn(async move {
                while let Some(sequence) = made.recv().await {
                    done_writing.send(("written", subscriber, sequence)).unwrap();
                }
            });
        }
        for sequence in [7, 8] {
            engine.send_replace(numbered(sequence));
            for subscriber in 0..3 {
                assert_eq!(seen.recv().await, Some(("made", subscriber, sequence)));
                assert_eq!(seen.recv().await, Some(("written", subscriber, sequence)));
            }
        }
    }

    #[tokio::test]
    async fn whoever_joins_has_the_newest_and_waits_for_what_comes() {
        let Scene { turns, engine, .. } = scene();
        engine.send_replace(numbered(3));
        let mut snapshots = turns.join(0);
        assert_eq!(snapshots.borrow().sequence, 3);
        assert!(!snapshots.has_changed().unwrap());
        engine.send_replace(numbered(4));
        while next(&mut snapshots).await != Some(4) {} // the 3 may be handed over first
    }

    #[tokio::test]
    async fn the_newest_comes_once_more_when_it_has_to_be_judged_again() {
        let Scene { turns, engine, again } = scene();
        let mut snapshots = turns.join(0);
        engine.send_replace(numbered(3));
        assert_eq!(next(&mut snapshots).await, Some(3));
        again.send_replace(());
        assert_eq!(next(&mut snapshots).await, Some(3));
    }

    #[tokio::test]
    async fn whoever_has_gone_takes_no_turn_and_no_memory() {
        let Scene { turns, engine, .. } = scene();
        let (first, mut second, third) = (turns.join(0), turns.join(0), turns.join(0));
        drop((first, third));
        engine.send_replace(numbered(1));
        assert_eq!(next(&mut second).await, Some(1));
        let waiting = || turns.0[0].subscribers().as_ref().map(Vec::len);
        while waiting() != Some(1) {
            give_way().await;
        }
        // Also where nothing is published meanwhile.
        (0..1_000).for_each(|_| drop(turns.join(0)));
        assert_eq!(waiting(), Some(2), "the one that waits, and the last that came and went");
    }

    #[tokio::test]
    async fn when_the_engine_has_stopped_nobody_waits() {
        let Scene { turns, engine, .. } = scene();
        let mut before = turns.join(0);
        drop(engine);
        assert_eq!(next(&mut before).await, None);
        assert_eq!(next(&mut turns.join(0)).await, None);
    }
}
