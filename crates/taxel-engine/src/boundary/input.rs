//! What goes into the engine.

use std::sync::Arc;
use std::time::Duration;
use taxel_skin::BusIndex;
use taxel_wire::TimedFrame;

use crate::boundary::command::Command;
use crate::boundary::pushed::PushedScan;
use crate::calibration::job::FitOutcome;
use crate::calibration::samples::{NotLoaded, SessionSamples};
use crate::intake::health::BusNotice;
use crate::model_set::ModelSet;
use crate::request::RequestId;

/// One thing that happened.
#[derive(Debug)]
pub enum Input<'a> {
    /// Frames of one bus, in the order of reception.
    Frames(BusIndex, &'a [TimedFrame]),
    /// A scan that a program handed over.
    Pushed(&'a PushedScan),
    /// Something about the bus itself.
    Bus(BusIndex, BusNotice),
    /// Time passed: due at [`crate::Engine::next_deadline`], or staleness is seen late.
    Tick,
    /// The shell could not take frames for so long and takes now what waited: a board that was not heard meanwhile need
    /// not have been silent.
    Resumed(Duration),
    /// A command, to be answered with [`crate::Output::Reply`] carrying the same id.
    Command(RequestId, Command),
    /// A fit that was handed out has ended.
    Fitted(FitOutcome),
    /// Records that were handed out with [`crate::Output::Commit`] are on disk, or why not.
    Committed {
        /// The commit's ticket.
        ticket: u64,
        /// Whether they are.
        result: Result<(), String>,
    },
    /// Samples that were asked for with [`crate::Output::Load`], or why there are none.
    Loaded {
        /// The ticket of the question.
        ticket: u64,
        /// What the session gathered.
        result: Result<SessionSamples, NotLoaded>,
    },
    /// The model set that was asked for with [`crate::Output::LoadSet`], or why there is none.
    SetLoaded {
        /// The ticket of the question.
        ticket: u64,
        /// The set.
        result: Result<Arc<ModelSet>, NotLoaded>,
    },
    /// Samples of this session are on disk up to, not including, this index.
    Durable {
        /// Number of the session.
        session: u64,
        /// Samples on disk.
        samples: u64,
    },
    /// The store refused a write; why. No session can go on.
    StoreFailed(String),
    /// The store found that something on disk is not what was written: all that is damaged, a line each, also what was reported before.
    StoreDamaged(Vec<String>),
}
