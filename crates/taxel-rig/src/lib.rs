//! What gauges and drives of a vacuum rig say that are on no bus of the robot: pure, without I/O and total over all bytes.
//!
//! - [`Talk`]: what is asked of one, and what its bytes say.
//! - [`Template`]: where in a line of text the pressure is, and in which unit; [`Lines`]: from bytes to lines.
//! - [`modbus`]: registers, over TCP or a serial line.
//! - [`drive`]: the procedure of a pump that calibrates by itself; [`profile`]: what such a drive is told, in text or registers.
//! - [`Faults`]: what is wrong with a profile, or with the configuration of a gauge and all else.

pub mod drive;
mod faults;
mod lines;
pub mod modbus;
pub mod profile;
mod talk;
mod template;

pub use faults::Faults;
pub use lines::{LINE_BYTES_MAX, Lines};
pub use talk::{Speech, Talk};
pub use template::{Found, Template, numbers_of};
