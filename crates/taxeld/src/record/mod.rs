//! Recordings of the live traffic, where the configuration asks for them: nobody here waits for a disk.

mod begin;
mod follow;
mod tap;

pub use begin::begin;
pub use tap::Tap;
