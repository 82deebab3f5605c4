//! Bytes to meaning and back, without I/O and total over all byte strings.
//!
//! - [`Frame`]: a CAN frame, classic or FD, independent of any socket library.
//! - [`icub`]: what skin boards say, what the host tells them, and how two frames become one module scan.
//! - [`bits`]: a number anywhere in a frame; [`signal`]: the pressure of any other sensor, [`reading`] where it comes over no bus;
//!   [`array`](mod@array): the taxels of any other skin.
//! - [`candump`]: the log text of can-utils.
//!
//! Every decoder takes any frame or line there is: what it does not accept is refused with the reason, never lost
//! and never a panic.

pub mod array;
pub mod bits;
pub mod candump;
mod frame;
pub mod icub;
pub mod reading;
pub mod signal;

pub use frame::{CanId, FD_BYTES, Frame, FrameKind, TimedFrame};
