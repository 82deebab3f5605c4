//! What every source of frames can do.

use std::future::Future;
use taxel_wire::{Frame, TimedFrame};
use thiserror::Error;

/// What a bus has to say beside its frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// Frames can come (again).
    Up,
    /// No frame can come; why.
    Down(String),
    /// The kernel lost so many frames since the last such event: its receive buffer was full.
    Dropped(u64),
    /// The controller reports trouble, in words.
    ControllerError(String),
    /// The controller left the bus.
    BusOff,
    /// The receive buffer that the kernel granted, in bytes, where it is less than was asked for.
    SmallBuffer {
        /// Bytes granted.
        granted: usize,
        /// Bytes asked for.
        wanted: usize,
    },
}

/// What one call of [`FrameSource::next`] brought. Reused from call to call.
#[derive(Debug, Default)]
pub struct Batch {
    /// In the order of reception.
    pub frames: Vec<TimedFrame>,
    /// What happened before these frames.
    pub events: Vec<BusEvent>,
    /// No more will come: a log is over.
    pub end: bool,
}

impl Batch {
    /// Empties it.
    pub fn clear(&mut self) {
        self.frames.clear();
        self.events.clear();
        self.end = false;
    }
}

/// A source that cannot go on.
#[derive(Debug, Error)]
pub enum SourceError {
    /// The kernel or the file system says no, for good.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The kernel has no CAN.
    #[error("this kernel has no CAN sockets (AF_CAN): load the modules can and can-raw, or use a kernel that has them")]
    NoCan,
    /// More identifiers than the kernel filters.
    #[error(transparent)]
    Filters(#[from] crate::filter::TooManyFilters),
}

/// A frame that was not sent.
#[derive(Debug, Error)]
pub enum SendError {
    /// The source only listens.
    #[error("this bus is listen-only: nothing is sent")]
    ListenOnly,
    /// The kernel's queue stayed full.
    #[error("the send queue of {interface} stayed full for {waited_ms} ms: is another node on the bus?")]
    Full {
        /// The interface.
        interface: String,
        /// How long it was tried.
        waited_ms: u64,
    },
    /// The kernel says no.
    #[error("sending on {interface}: {source}")]
    Io {
        /// The interface.
        interface: String,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Where frames come from and go to. One task owns a source; nobody shares it.
pub trait FrameSource: Send {
    /// Waits for frames or events and puts them into `batch`, which is emptied first. Dropping the future loses
    /// nothing.
    ///
    /// # Errors
    /// [`SourceError`] if the source can never go on. What passes by itself is an event.
    fn next(&mut self, batch: &mut Batch) -> impl Future<Output = Result<(), SourceError>> + Send;

    /// Sends one frame.
    ///
    /// # Errors
    /// [`SendError`]; success means that the kernel took it, not that it reached the bus.
    fn send(&mut self, frame: &Frame) -> impl Future<Output = Result<(), SendError>> + Send;
}
