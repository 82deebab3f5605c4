//! Recordings of the live traffic, where the configuration asks for them: nobody here waits for a disk.

#[cfg(feature = "record")]
mod begin;
#[cfg(feature = "record")]
mod follow;
#[cfg(not(feature = "record"))]
mod none;
mod tap;

#[cfg(feature = "record")]
pub use begin::begin;
#[cfg(not(feature = "record"))]
pub use none::begin;
pub use tap::Tap;
