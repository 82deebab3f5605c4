//! Bytes to meaning and back, without I/O and total over all byte strings.

mod frame;

pub use frame::{CanId, Frame, FrameKind, TimedFrame};
