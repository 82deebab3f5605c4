//! What gauges of a vacuum rig say that are on no bus of the robot: pure, without I/O and total over all bytes.
//!
//! - [`Template`]: where in a line of text the pressure is, and in which unit.
//! - [`Lines`]: from bytes to lines.

mod lines;
mod template;

pub use lines::{LINE_BYTES_MAX, Lines};
pub use template::{Template, TemplateFault, Unread, numbers_of};
