//! The force and the events for whoever keeps them within this process: the recording. It gets what a subscriber gets,
//! judged at the moment at which it is taken, and needs neither a role nor a place among the streams.

use std::sync::Arc;

use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::v1;
use tokio::sync::watch;

use crate::convert::{self, Sending};
use crate::events::message;
use crate::handle::Handle;

/// The states of one patch as they come; the newest wins.
pub struct PatchFollower {
    handle: Handle,
    patch: usize,
    snapshots: watch::Receiver<Arc<PatchSnapshot>>,
    /// Number of the state that was taken last.
    last: Option<u64>,
}

impl PatchFollower {
    /// Follows the patch at this position of the plan; `None` if there is none.
    #[must_use]
    pub fn new(handle: &Handle, patch: usize) -> Option<Self> {
        let snapshots = handle.patches.get(patch)?.snapshot.clone();
        Some(Self { handle: handle.clone(), patch, snapshots, last: None })
    }

    /// The force of the next state, and its taxels where they are wanted. `None` when the engine has stopped.
    pub async fn next(&mut self, taxels: bool) -> Option<(v1::ForceSample, Option<v1::TaxelSample>)> {
        self.snapshots.changed().await.ok()?;
        let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
        let (now, sequence) = ((self.handle.clock)(), snapshot.sequence);
        let freshness = self.handle.freshness_at(now, self.patch, &snapshot);
        let skipped = self.last.replace(sequence).map_or(0, |last| sequence.saturating_sub(last + 1));
        let sending = Sending { now, freshness, skipped };
        let plan = &self.handle.plan.patches[self.patch];
        let readings = taxels.then(|| convert::taxels(plan, &snapshot, sending));
        Some((convert::force(plan, &snapshot, sending), readings))
    }
}

/// All events, from the first that is still kept.
pub struct EventFollower {
    handle: Handle,
    newest: watch::Receiver<u64>,
    last: u64,
}

impl EventFollower {
    /// Follows the events of this daemon.
    #[must_use]
    pub fn new(handle: &Handle) -> Self {
        Self { handle: handle.clone(), newest: handle.events.watch(), last: 0 }
    }

    /// The next event. `None` when nobody is left who could tell one.
    pub async fn next(&mut self) -> Option<v1::Event> {
        loop {
            let present = *self.newest.borrow_and_update();
            let skipped = self.handle.events.oldest().saturating_sub(self.last + 1);
            if let Some(event) = self.handle.events.next(self.last, |_| true) {
                self.last = event.0;
                return Some(message(&event, skipped));
            }
            self.last = self.last.max(present);
            self.newest.changed().await.ok()?;
        }
    }
}
