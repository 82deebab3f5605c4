//! taxel-lab as shipped, and its certificates.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test's helpers fail as the test does

mod bad_recordings;
mod certificate;
mod commands;
mod recalibration;
mod recordings;
