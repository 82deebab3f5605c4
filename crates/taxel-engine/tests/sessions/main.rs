//! Sessions against a table: random steps of operators, time, buses, fits and disks, restarts included, and after each
//! of them the engine has to be where [`model::Model`] says.
//!
//! A failure prints the whole sequence, the shortest that was found, and the seed that gives it again:
//! `PROPTEST_RNG_SEED=... cargo test -p taxel-engine --test sessions`. `PROPTEST_CASES` sets the number of sequences.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod check;
mod daemon;
#[path = "../common/disk.rs"]
#[allow(dead_code)]
mod disk;
mod found;
mod model;
mod store;
mod walk;
mod world;
