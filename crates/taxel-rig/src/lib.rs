//! What gauges of a vacuum rig say that are on no bus of the robot: pure, without I/O and total over all bytes.
//!
//! - [`Talk`]: what is asked of one, and what its bytes say.
//! - [`Template`]: where in a line of text the pressure is, and in which unit; [`Lines`]: from bytes to lines.
//! - [`modbus`]: a register.

mod lines;
pub mod modbus;
mod talk;
mod template;

pub use lines::{LINE_BYTES_MAX, Lines};
pub use talk::{Speech, Talk};
pub use template::{Template, TemplateFault, Unread, numbers_of};
