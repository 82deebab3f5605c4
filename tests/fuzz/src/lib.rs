//! Targets of fuzzing: each takes any bytes, reads them as one kind of input from outside, and panics if what must hold
//! of that does not. `libfuzzer/` runs them for long, `tests/corpus.rs` on kept inputs and random changes of these.

// Modules of taxeld that are compiled here have tests of their own, which run there.
#![cfg(not(test))]
// A target says by a panic that something is wrong.
#![allow(clippy::expect_used, clippy::panic)]

mod bytes;
pub mod calls;
pub mod csv;
pub mod frames;
pub mod log;
pub mod mcap;
pub mod models;
pub mod positions;
mod requests;
pub mod toml;

// taxeld is a program and no library: the modules of it that read files are compiled once more here.
#[allow(dead_code, unused_imports)]
#[path = "../../../crates/taxeld/src/config/mod.rs"]
mod config;
#[allow(dead_code, unused_imports)]
#[path = "../../../crates/taxeld/src/rig/mod.rs"]
mod rig;
#[allow(dead_code)] // what only commands read
#[path = "../../../crates/taxeld/src/values.rs"]
mod values;

/// Something that reads input from outside.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, that of its folders in `corpus/` and `finds/`, and that of its binary.
    pub name: &'static str,
    /// Reads any bytes; panics if what must hold does not.
    pub run: fn(&[u8]),
    /// Random changes that the plain tests try: some tenths of a second.
    pub changes: u32,
}

const fn target(name: &'static str, run: fn(&[u8]), changes: u32) -> Target {
    Target { name, run, changes }
}

/// Every target.
pub const TARGETS: &[Target] = &[
    target("frames", frames::run, 10_000),
    target("log", log::run, 3_000),
    target("positions", positions::run, 5_000),
    target("csv", csv::run, 5_000),
    target("toml", toml::run, 1_000),
    target("models", models::run, 2_000),
    target("calls", calls::run, 3_000),
    target("mcap", mcap::run, 3_000),
];
