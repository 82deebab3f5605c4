//! Frames in and out.
//!
//! [`FrameSource`] is one live bus, for example a real interface ([`SocketCan`]). It hands out [`Batch`]es of timed frames and
//! says what happened to the bus itself. [`RemoteBus`] is what is no interface, [`RecordedFrames`] a log.
//!
//! Principles:
//! 1. One owner per bus, and no thread, queue or lock in between: the kernel's buffer is the only queue. It holds
//!    half a second of a full bus, and every frame that it loses is counted.
//! 2. A wait is for the socket or for a timer, never a spin. Cancelling [`FrameSource::next`] loses no frame.
//! 3. The kernel tells of an interface's end once and is silent ever after. So an error moves the state at once, and
//!    a look at the link every [`LINK_POLL`] finds what no error told.
//! 4. `unsafe` is in the module `sys` only, around the calls that no crate offers.

mod can_error;
mod clock;
mod filter;
mod log_reader;
mod log_report;
mod log_times;
mod recorded;
mod remote;
mod rx;
mod socket_can;
mod source;
#[allow(unsafe_code)]
mod sys;
mod tx;

pub use can_error::{BusError, ErrorCounters, decode as each_bus_error};
pub use clock::ClockReading;
pub use log_reader::LogReader;
pub use log_report::{BadLine, LogReport};
pub use log_times::LogTimes;
pub use recorded::{Lanes, RecordedFrames, Run};
pub use remote::{Pause, Remote, RemoteBus};
pub use socket_can::{LINK_POLL, OpenError, SocketCan, SocketCanOptions};
pub use source::{Batch, BusEvent, DownReason, FrameSource, NotSent, SendError, SourceError};
