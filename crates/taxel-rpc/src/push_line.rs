//! The way of pushed scans from the service to the engine's task: bounded for each patch, with one pusher a patch.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use taxel_engine::PushedScan;
use taxel_skin::BusIndex;
use taxel_wire::TimedFrame;
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
    /// A reading of a gauge, as a frame of it.
    Reading(TimedFrame),
    /// No more scans, and why.
    Ended(String),
}

/// The service's end of the line. Cheap to clone.
#[derive(Clone, Debug)]
pub struct PushLine {
    to_engine: mpsc::Sender<Pushed>,
    /// Who pushes, by the position of the patch in the plan.
    pushers: Arc<Mutex<BTreeMap<usize, String>>>,
}

/// Makes both ends for so many patches.
#[must_use]
pub fn push_line(patches: usize) -> (PushLine, mpsc::Receiver<Pushed>) {
    // The scans that may wait, and the end of the stream that they came on.
    let (to_engine, pushed) = mpsc::channel(patches.max(1) * (SCANS_WAITING_MAX + 1));
    (PushLine { to_engine, pushers: Arc::default() }, pushed)
}

impl PushLine {
    /// Makes `who` the pusher of a patch.
    ///
    /// # Errors
    /// Who is it already.
    pub(crate) fn begin(&self, patch: usize, bus: BusIndex, who: &str) -> Result<Pusher, String> {
        let mut pushers = self.pushers();
        if let Some(other) = pushers.get(&patch) {
            return Err(other.clone());
        }
        pushers.insert(patch, who.to_owned());
        let room = Arc::new(Semaphore::new(SCANS_WAITING_MAX));
        let (line, why) = (self.clone(), String::new());
        Ok(Pusher { line, patch, bus, room, taken: 0, refused: 0, untold: 0, why })
    }

    fn pushers(&self) -> MutexGuard<'_, BTreeMap<usize, String>> {
        self.pushers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The one that pushes the scans of a patch, until it is dropped.
#[derive(Debug)]
pub(crate) struct Pusher {
    line: PushLine,
    patch: usize,
    bus: BusIndex,
    /// For its scans that wait for the engine.
    room: Arc<Semaphore>,
    taken: u64,
    refused: u64,
    /// Of the refused ones, those that the engine does not know of.
    untold: u64,
    /// Why no more come; empty while the engine has let nobody begin.
    why: String,
}

impl Pusher {
    /// Hands a scan or a reading over if there is room for it, and counts it.
    pub(crate) fn push(&mut self, event: PushEvent) {
        let sent = Arc::clone(&self.room).try_acquire_owned().is_ok_and(|place| {
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

    /// The engine takes its scans from now on.
    pub(crate) fn begun(&mut self) {
        "the program that pushed its scans has gone".clone_into(&mut self.why);
    }

    /// No more scans come, for this reason. Gives how many were taken and refused.
    pub(crate) fn end(mut self, why: String) -> (u64, u64) {
        self.why = why;
        (self.taken, self.refused)
    }
}

impl Drop for Pusher {
    fn drop(&mut self) {
        if !self.why.is_empty() {
            let event = PushEvent::Ended(std::mem::take(&mut self.why));
            // There is room beside the scans, unless the engine hangs, which is a silence as well.
            let _ = self.line.to_engine.try_send(Pushed { bus: self.bus, refused: self.untold, event, _place: None });
        }
        self.line.pushers().remove(&self.patch); // only then may another one begin
    }
}
