//! The simulated skin and its boards, as a host sees them.
#![allow(clippy::unwrap_used)] // a test's helpers fail as the test does

mod common;
mod faults;
mod physics;
mod protocol;
