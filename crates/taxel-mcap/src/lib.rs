//! Recordings as MCAP files, the container of Foxglove and ROS 2: live traffic and sessions, in messages of `taxel.v1`.
//!
//! Principles:
//! 1. A caller of [`Recorder`] never waits for a disk: its queue is bounded, and what it has no room for
//!    is counted.
//! 2. Every second what was gathered becomes a chunk of the file and goes to the disk. Whatever happens then, that chunk
//!    can be read, also without the summary that only a file that was closed has.
//! 3. Only files of our own pattern are ever counted or deleted ([`Folder`]).
//! 4. No record that is read takes more than 32 MB of memory, and no chunk with a wrong checksum is read ([`Recording`]).

mod file;
mod folder;
mod frames;
mod name;
mod queue;
mod recorder;
mod recording;
mod schema;

pub use file::{McapFault, McapFile, Topic};
pub use folder::Folder;
pub use frames::{FrameTap, frames_message};
pub use name::FileName;
pub use queue::{Given, Queue, Status};
pub use recorder::{Limits, Opener, Recorder, open_file};
pub use recording::Recording;
pub use schema::schema_of;
