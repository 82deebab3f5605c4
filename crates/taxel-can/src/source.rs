//! One bus as the daemon sees it.

use std::fmt;
use std::future::Future;
use std::time::Duration;

use taxel_wire::{CanId, Frame, TimedFrame};
use thiserror::Error;

use crate::can_error::BusError;

/// What a source hands out at once; the caller keeps it and its memory is used again.
///
/// The events are to be taken before the frames: an end of the bus ends the trust in what came before, and the frames
/// are newer than that.
#[derive(Debug, Default)]
pub struct Batch {
    /// Data and remote frames, in the order of reception. Error frames are told as [`BusEvent::Error`].
    pub frames: Vec<TimedFrame>,
    /// Error frames of a real bus's controller as they came, for recordings of the bus.
    pub errors: Vec<TimedFrame>,
    /// What happened to the bus, in order.
    pub events: Vec<BusEvent>,
}

impl Batch {
    /// Empties it and keeps its memory.
    pub fn clear(&mut self) {
        self.frames.clear();
        self.errors.clear();
        self.events.clear();
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty() && self.events.is_empty()
    }
}

/// What happened to a bus, beside its frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// Frames can come: at the start, and after each [`BusEvent::Down`].
    Up,
    /// No frame can come. Told once for each change of the reason.
    Down {
        /// Why.
        reason: DownReason,
    },
    /// As [`BusEvent::Down`], of a source that is no network interface.
    SourceDown {
        /// Why, for people.
        why: String,
    },
    /// A frame made by the controller or its driver, one event for each thing it reports.
    Error {
        /// What it reports.
        error: BusError,
        /// A process of this machine wrote it: on a real device a forgery, since only its driver makes error frames.
        local: bool,
    },
    /// The kernel lost so many frames since the last such event, because its buffer was full.
    /// Frames sent = frames read + the sum of these, to the frame.
    Dropped {
        /// Newly lost frames.
        frames: u64,
    },
    /// So many reads were no classic CAN frame (short, cut off or of a length above eight) and were refused.
    Malformed {
        /// Newly refused reads.
        frames: u64,
    },
    /// So many lines of text, or answers, were no reading of the gauge that sends them.
    Unread {
        /// How many.
        lines: u64,
        /// Why the last of them is none, for people.
        why: String,
    },
    /// The size of the kernel's receive buffer, told after each opening.
    BufferGranted {
        /// What the kernel granted, in bytes of kernel memory.
        bytes: usize,
        /// What half a second of a full bus takes.
        wanted: usize,
    },
}

impl fmt::Display for BusEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Up => f.write_str("the bus is up"),
            Self::Down { reason } => write!(f, "the bus is down: {reason}"),
            Self::SourceDown { why } | Self::Unread { why, .. } => f.write_str(why),
            Self::Error { error, .. } => write!(f, "error frame: {error}"),
            Self::Dropped { frames } => write!(f, "the kernel lost {frames} frames: its receive buffer was full"),
            Self::Malformed { frames } => write!(f, "{frames} reads were no classic CAN frame"),
            Self::BufferGranted { bytes, wanted } => write!(f, "receive buffer: {bytes} bytes of {wanted} wanted"),
        }
    }
}

/// Why no frame can come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DownReason {
    /// There is no interface of this name: not yet, or no longer.
    NoInterface,
    /// The interface is there and was set down, or never set up.
    InterfaceDown,
    /// The interface is up and has no carrier: the controller is bus-off, or the cable's other end is down.
    NoCarrier,
    /// The system refuses to open or read the socket; it is tried again, as for the others.
    System {
        /// The system's answer.
        errno: i32,
    },
}

impl fmt::Display for DownReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoInterface => f.write_str("no interface of this name"),
            Self::InterfaceDown => f.write_str("the interface is down"),
            Self::NoCarrier => f.write_str("no carrier (the controller is bus-off, or the other end is down)"),
            Self::System { errno } => write!(f, "{}", std::io::Error::from_raw_os_error(*errno)),
        }
    }
}

/// Why a source cannot go on. What a source can recover from by itself is a [`BusEvent`] instead.
#[derive(Debug, Error)]
pub enum SourceError {
    /// The runtime that waits for the socket has ended.
    #[error("interface {interface}: cannot wait for frames: {error}")]
    Runtime {
        /// The bus.
        interface: String,
        /// What it answers.
        error: std::io::Error,
    },
}

/// A frame that was not sent.
#[derive(Debug, Error)]
#[error("frame {id} not sent: {why}")]
pub struct SendError {
    /// Of the frame.
    pub id: CanId,
    /// Why.
    pub why: NotSent,
}

/// Why a frame was not sent.
#[derive(Debug, Error)]
pub enum NotSent {
    /// The bus was opened to listen only.
    #[error("the interface was opened to listen only")]
    ListenOnly,
    /// Error frames are made by controllers, and bring-up commands are classic frames.
    #[error("it is no classic data or remote frame")]
    Kind,
    /// The bus is down.
    #[error("{0}")]
    Down(DownReason),
    /// The transmit queue stayed full for so long.
    #[error("transmit queue full for {0:?}")]
    QueueFull(Duration),
    /// Anything else the system answers.
    #[error("{0}")]
    System(std::io::Error),
}

/// One bus: frames come out in batches, single frames go in.
pub trait FrameSource: Send {
    /// Waits until there is something and puts it into `batch`, whose former content goes.
    ///
    /// May be cancelled at any time: what was not handed out comes with the next call.
    ///
    /// # Errors
    /// Only what ends the source for good.
    fn next(&mut self, batch: &mut Batch) -> impl Future<Output = Result<(), SourceError>> + Send;

    /// Queues one frame for the bus. Success means queued: whether it was acknowledged on the wire is not known.
    ///
    /// # Errors
    /// [`SendError`]; the frame is then not queued.
    fn send(&mut self, frame: &Frame) -> impl Future<Output = Result<(), SendError>> + Send;
}
