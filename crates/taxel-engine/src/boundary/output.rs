//! What the engine wants done.

use std::sync::Arc;
use taxel_skin::BusIndex;
use taxel_wire::Frame;

use crate::boundary::catalogue::Catalogue;
use crate::boundary::command::Reply;
use crate::boundary::record::Record;
use crate::boundary::snapshot::{GaugeReading, Health, PatchSnapshot};
use crate::calibration::job::FitJob;
use crate::calibration::view::SessionView;
use crate::request::RequestId;

/// One thing that the shell has to do.
#[derive(Debug)]
pub enum Output {
    /// New live state of the patch with this position.
    Patch(usize, Arc<PatchSnapshot>),
    /// The session of the patch with this position changed.
    Session(usize, Arc<SessionView>),
    /// The patch with this position has no session any more: it was deleted.
    SessionGone(usize),
    /// What the gauge of the patch with this position reads now.
    Gauge(usize, GaugeReading),
    /// Buses, boards or modules changed.
    Health(Arc<Health>),
    /// Sessions or model sets changed.
    Catalogue(Arc<Catalogue>),
    /// Send this frame on this bus.
    Send(BusIndex, Frame),
    /// Run this (it takes milliseconds, so not here) and hand its outcome back as [`crate::Input::Fitted`].
    Fit(FitJob),
    /// Write this to disk.
    Record(Record),
    /// Write these to disk and say how that went with [`crate::Input::Committed`]: their effect waits for it.
    Commit {
        /// To be given back.
        ticket: u64,
        /// In this order, after every record that came before.
        records: Vec<Record>,
    },
    /// Read the samples of a session, with every record that came before, and give them with [`crate::Input::Loaded`].
    Load {
        /// To be given back.
        ticket: u64,
        /// Number of the session.
        session: u64,
    },
    /// Read a model set, with every record that came before, and give it with [`crate::Input::SetLoaded`].
    LoadSet {
        /// To be given back.
        ticket: u64,
        /// Its id.
        model_set: String,
    },
    /// Answer a command, once every record that came before is on disk.
    Reply(RequestId, Reply),
}
