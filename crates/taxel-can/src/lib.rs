//! Frames in and out, behind one [`FrameSource`]: a real SocketCAN interface or a candump log.
//!
//! This is the only crate with `unsafe`: batch reads (`recvmmsg`), one socket option and the registration of a
//! descriptor with the runtime have no safe form. Each such place says why it is sound.

pub mod clock;
mod filter;
mod replay;
mod socketcan;
mod source;

pub use filter::{FILTERS_MAX, TooManyFilters};
pub use replay::{LogReader, Pace, Replay, ReplayReport};
pub use socketcan::{Options, SocketCan};
pub use source::{Batch, BusEvent, FrameSource, SendError, SourceError};
