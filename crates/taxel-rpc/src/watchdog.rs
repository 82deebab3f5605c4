//! Looks whether the engine runs and whether its newest values may still be believed, and tells everybody when that
//! changes without a new value: a stream without a rate would be silent otherwise, and a silent stream looks healthy.

use std::convert::Infallible;
use std::future::pending;
use std::time::Duration;
use tokio::sync::watch;

use crate::freshness::{Freshness, not_run_for};
use crate::handle::Handle;
use crate::health::Report;

/// By so much at most subscribers and the health report are told too late. A look takes microseconds.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Watches one engine.
pub(crate) struct Watchdog {
    handle: Handle,
    report: Report,
    /// Wakes every subscriber without a rate, who judges for itself what it has to be told.
    wake: watch::Sender<()>,
    /// What was found last: per patch the number of the snapshot and what became of it.
    found: Vec<(u64, Freshness)>,
    stalled: bool,
}

impl Watchdog {
    /// Watches the engine behind `handle` and wakes subscribers by `wake`.
    pub(crate) fn new(handle: Handle, report: Report, wake: watch::Sender<()>) -> Self {
        let found = vec![(0, Freshness::Fresh); handle.patches.len()];
        Self { handle, report, wake, found, stalled: false }
    }

    /// Watches until the shutdown, and then ends every health stream, which would hold the server open otherwise.
    pub(crate) async fn keep(mut self) -> Infallible {
        let shutdown = self.handle.shutdown.clone();
        loop {
            self.look();
            self.report.update().await;
            tokio::select! {
                () = shutdown.cancelled() => break,
                () = tokio::time::sleep(LOOK_EVERY) => {}
            }
        }
        self.report.end().await;
        pending().await
    }

    fn look(&mut self) {
        let running = self.handle.is_connected();
        let stalled_for = self.handle.stalled_for().filter(|_| running);
        if let Some(silence) = stalled_for.filter(|_| !self.stalled) {
            tracing::warn!("{}: nothing that it published counts as good until it does", not_run_for(silence));
        }
        self.stalled = stalled_for.is_some(); // its end is logged where it runs again, which knows the length
        let mut changed = false;
        for (patch, found) in self.found.iter_mut().enumerate() {
            let snapshot = self.handle.patches[patch].snapshot.borrow();
            let (sequence, freshness) = (snapshot.sequence, self.handle.sending(patch, &snapshot, 0).freshness);
            // A snapshot that is seen here for the first time and is old already may have been sent while it was fresh.
            changed |= !freshness.is_like(found.1) || (sequence != found.0 && !freshness.is_fresh());
            *found = (sequence, freshness);
        }
        if changed {
            self.wake.send_replace(());
        }
    }
}
