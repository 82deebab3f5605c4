//! What goes into the engine and what comes out: the whole boundary between the core and the world.

use std::sync::Arc;
use taxel_skin::{BusIndex, Time};
use taxel_wire::{Frame, TimedFrame};

use crate::command::{Command, Reply, RequestId};
use crate::model_set::ModelSet;
use crate::record::Record;
use crate::session::{FitJob, FitOutcome, SessionView};
use crate::snapshot::{Catalogue, Health, PatchSnapshot};
use crate::validation::Load;

/// The present, as the shell knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Now {
    /// On the run's clock; deadlines and order.
    pub time: Time,
    /// Nanoseconds since 1970, only ever a label.
    pub wall_ns: i64,
}

/// What a bus tells beside its frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusNotice {
    /// Frames can come again.
    Up,
    /// No frame can come; why.
    Down(String),
    /// The kernel lost so many frames that this process had asked for.
    Dropped(u64),
    /// The controller reported an error (bus-off, error-passive, ...).
    ControllerError(String),
    /// The controller left the bus: nothing it sends can be trusted until it is back.
    BusOff,
}

impl Now {
    /// The moment at which a frame was received that is being looked at now; a stamp from the future counts as now.
    #[must_use]
    pub fn at(self, time: Time) -> Self {
        let time = time.min(self.time);
        let wall_offset_ns = self.wall_ns.saturating_sub(self.time.as_nanos());
        Self { time, wall_ns: time.as_nanos().saturating_add(wall_offset_ns) }
    }
}

/// One thing that happened.
#[derive(Debug)]
pub enum Input<'a> {
    /// Frames of one bus, in the order of reception.
    Frames(BusIndex, &'a [TimedFrame]),
    /// Something about the bus itself.
    Bus(BusIndex, BusNotice),
    /// Time passed. At least every 10 ms, or staleness is seen late.
    Tick,
    /// A command, to be answered with [`Output::Reply`] carrying the same id.
    Command(RequestId, Command),
    /// A fit that was handed out has ended.
    Fitted(FitOutcome),
    /// Samples of this session are on disk up to, not including, this index.
    Durable {
        /// Number of the session.
        session: u64,
        /// Samples on disk.
        samples: u64,
    },
    /// The store refused a write; why. No session can go on.
    StoreFailed(String),
}

/// One thing that the shell has to do.
#[derive(Debug)]
pub enum Output {
    /// New live state of the patch with this position.
    Patch(usize, Arc<PatchSnapshot>),
    /// The session of the patch with this position changed.
    Session(usize, Arc<SessionView>),
    /// Buses, boards or modules changed.
    Health(Arc<Health>),
    /// Sessions or model sets changed.
    Catalogue(Arc<Catalogue>),
    /// Send this frame on this bus.
    Send(BusIndex, Frame),
    /// Run this (it takes milliseconds, so not here) and hand its outcome back as [`Input::Fitted`].
    Fit(FitJob),
    /// Write this to disk.
    Record(Record),
    /// Answer a command, once every record that came before is on disk.
    Reply(RequestId, Reply),
}

/// What the store found at start.
#[derive(Clone, Debug, Default)]
pub struct Restored {
    /// Every stored model set, oldest first.
    pub model_sets: Vec<Arc<ModelSet>>,
    /// Per patch name: the active model set.
    pub active: Vec<(String, String)>,
    /// Every session that ended, oldest first, and those that were interrupted (state `Interrupted`).
    pub sessions: Vec<RestoredSession>,
    /// The number that the next session gets.
    pub next_session: u64,
    /// Every known load, oldest first.
    pub loads: Vec<Arc<Load>>,
    /// The number that the next known load gets.
    pub next_load: u64,
}

/// A session as the store found it.
#[derive(Clone, Debug)]
pub struct RestoredSession {
    /// Its last state; a session that was under way is `Interrupted`.
    pub view: Arc<SessionView>,
    /// Its samples, if it can go on: it was interrupted, or it is the newest of its patch and waits for review.
    pub samples: Option<crate::session::SessionSamples>,
}
