//! The newest force of each patch in shared memory, for controllers of the same machine: a page a patch, which a daemon
//! writes and any number of readers look at, without a system call and without a word between them.
//!
//! Principles:
//! 1. The reader judges, by its own reading of `CLOCK_BOOTTIME`. A daemon that hangs, is killed or was replaced writes
//!    nothing any more, so what it wrote grows old and is refused ([`Page::force`]).
//! 2. A sample is whole or refused. The page holds two samples; the writer never touches the newest one (`latch`).
//! 3. Readers map the page read-only. Nothing that they do, or leave undone, reaches the writer, which never waits.
//! 4. Pages lie in a folder of one daemon, in which nobody else can write: the daemon takes no other ([`Folder`]), a reader believes no
//!    other ([`Page::open`]).
//! 5. A page is complete before it has its name, and no page is used again: a new daemon makes new ones.
//!
//! Every byte of a page is described in `deploy/shared-memory.md` of the repository; `deploy/taxel_force.h` reads the same
//! pages in C and C++, `deploy/python` in Python.

mod clock;
mod error;
mod folder;
mod force;
mod latch;
mod layout;
#[allow(unsafe_code)]
mod map;
mod reader;
mod sample;
mod text;
mod writer;

pub use clock::now_ns;
pub use error::PageError;
pub use folder::Folder;
pub use force::{Force, Limits, NoForce};
pub use layout::{PAGE_BYTES, VERSION};
pub use reader::{Page, Reader};
pub use sample::{Sample, State};
pub use text::Text;
pub use writer::PageWriter;
