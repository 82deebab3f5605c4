//! What gauges of a vacuum rig say that are on no bus of the robot: pure, without I/O and total over all bytes.
//!
//! - [`Template`]: where in a line of text the pressure is, and in which unit.
//! - [`Lines`]: from bytes to lines.
//! - [`drive`]: the course of a pump that calibrates by itself; [`profile`]: what such a drive is told in lines of text.

pub mod drive;
mod lines;
pub mod profile;
mod template;

pub use lines::{LINE_BYTES_MAX, Lines};
pub use template::{Template, TemplateFault, Unread, numbers_of};
