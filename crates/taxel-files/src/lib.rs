//! What a command reads and writes, and says to people. `-` is the standard input or output.

mod read;
pub mod say;
mod write;

pub use read::{named, open, read_any_text, read_text, read_utf8};
pub use write::{Output, announce, is_standard, quiet_end, write_text};
