//! The way of pushed scans from the service to the engine's task: bounded for each patch, with one pusher a patch.

use std::sync::{Arc, Mutex, PoisonError};

use taxel_engine::PushedScan;
use taxel_skin::BusIndex;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};

/// Scans of one patch that may wait for the engine's task. It takes one in microseconds, so more than a few waiting means
/// that the task hangs or that they come far too fast; either way they would be refused later.
pub const SCANS_WAITING_MAX: usize = 8;

/// Something on its way to the engine's task.
#[derive(Debug)]
pub struct Pushed {
    /// The bus of the patch, which is no real one.
    pub bus: BusIndex,
    /// Scans of this patch that found no room since what came before.
    pub refused: u64,
    /// What it is.
    pub event: PushEvent,
    /// Free again when it is taken.
    _place: Option<OwnedSemaphorePermit>,
}

/// What comes from a pusher.
#[derive(Debug)]
pub enum PushEvent {
    /// A scan.
    Scan(PushedScan),
    /// No more scans, and why.
    Ended(String),
}

/// The service's end of the line. Cheap to clone.
#[derive(Clone, Debug)]
pub struct PushLine {
    to_engine: mpsc::Sender<Pushed>,
    patches: Arc<[PatchLine]>,
}

/// What is known of one patch.
#[derive(Debug)]
struct PatchLine {
    room: Arc<Semaphore>,
    /// Who pushes its scans.
    pusher: Mutex<Option<String>>,
}

/// Makes both ends for so many patches.
#[must_use]
pub fn push_line(patches: usize) -> (PushLine, mpsc::Receiver<Pushed>) {
    // The scans that may wait, and the end of the stream that they came on.
    let (to_engine, pushed) = mpsc::channel(patches.max(1) * (SCANS_WAITING_MAX + 1));
    let patch = |_| PatchLine { room: Arc::new(Semaphore::new(SCANS_WAITING_MAX)), pusher: Mutex::default() };
    (PushLine { to_engine, patches: (0..patches).map(patch).collect() }, pushed)
}

impl PushLine {
    /// Makes `who` the pusher of a patch.
    ///
    /// # Errors
    /// Who is it already.
    pub(crate) fn begin(&self, patch: usize, bus: BusIndex, who: &str) -> Result<Pusher, String> {
        let Some(line) = self.patches.get(patch) else { return Err("nobody can be".to_owned()) };
        let mut pusher = line.pusher.lock().unwrap_or_else(PoisonError::into_inner);
        match &*pusher {
            Some(other) => Err(other.clone()),
            None => {
                *pusher = Some(who.to_owned());
                Ok(Pusher { line: self.clone(), patch, bus, taken: 0, refused: 0, untold: 0 })
            }
        }
    }
}

/// The one that pushes the scans of a patch, until it is dropped.
#[derive(Debug)]
pub(crate) struct Pusher {
    line: PushLine,
    patch: usize,
    bus: BusIndex,
    taken: u64,
    refused: u64,
    /// Of the refused ones, those that the engine does not know of.
    untold: u64,
}

impl Pusher {
    /// Hands a scan over if there is room for it, and counts it.
    pub(crate) fn push(&mut self, scan: PushedScan) {
        let room = self.line.patches.get(self.patch).and_then(|line| Arc::clone(&line.room).try_acquire_owned().ok());
        let sent = room.is_some_and(|place| {
            let event = PushEvent::Scan(scan);
            let pushed = Pushed { bus: self.bus, refused: self.untold, event, _place: Some(place) };
            self.line.to_engine.try_send(pushed).is_ok()
        });
        if sent {
            self.taken += 1;
            self.untold = 0;
        } else {
            self.refused += 1;
            self.untold += 1;
        }
    }

    /// Whether there is an engine's task that takes scans.
    pub(crate) fn is_connected(&self) -> bool {
        !self.line.to_engine.is_closed()
    }

    /// Scans that were taken and refused.
    pub(crate) const fn counts(&self) -> (u64, u64) {
        (self.taken, self.refused)
    }

    /// Tells the engine that no more scans come, and why. Only then may another one begin.
    pub(crate) async fn end(self, why: String) {
        let pushed = Pushed { bus: self.bus, refused: self.untold, event: PushEvent::Ended(why), _place: None };
        let _ = self.line.to_engine.send(pushed).await; // the engine has stopped: nobody is left to tell
    }
}

impl Drop for Pusher {
    fn drop(&mut self) {
        if let Some(line) = self.line.patches.get(self.patch) {
            *line.pusher.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }
}
