//! The force for whoever keeps it within this process: the recording. It gets what a subscriber gets,
//! judged at the moment at which it is taken, and needs neither a role nor a place among the streams.

use std::sync::Arc;

use taxel_engine::snapshot::PatchSnapshot;
use taxel_proto::v1;
use tokio::sync::watch;

use crate::convert;
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
        let sequence = snapshot.sequence;
        let skipped = self.last.replace(sequence).map_or(0, |last| sequence.saturating_sub(last + 1));
        let sending = self.handle.sending(self.patch, &snapshot, skipped);
        let plan = &self.handle.plan.patches[self.patch];
        let readings = taxels.then(|| convert::taxels(plan, &snapshot, sending));
        Some((convert::force(plan, &snapshot, sending), readings))
    }
}
