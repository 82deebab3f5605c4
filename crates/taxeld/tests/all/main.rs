//! taxeld as its users start it: one program of tests, so that it is linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test's helpers fail as the test does

mod cli;
mod common;
#[cfg(feature = "sim")]
mod daemon;
#[cfg(feature = "sim")]
mod demo;
#[cfg(feature = "sim")]
mod dial;
#[cfg(feature = "sim")]
mod kills;
mod logs;
#[cfg(feature = "sim")]
mod one_bag;
#[cfg(feature = "sim")]
mod operator;
#[cfg(feature = "sim")]
mod scarce;
#[cfg(feature = "sim")]
mod security;
#[cfg(feature = "sim")]
mod systemd;
#[cfg(feature = "sim")]
mod walkthrough;
