//! Whole scenes in virtual time: the simulated skin on one side, the engine on the other, nothing between.
//!
//! Every invariant of the house is held by a test that names it. Whatever a test is about, [`host::Host`] looks at
//! everything that the engine puts out: numbers are finite, a stale taxel has no reading, a force has its state.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bench;
mod host;
mod rig;
mod shared;
mod truth;
mod watch;

mod activation;
mod alarms;
mod branches;
mod bring_up;
mod calibrate;
mod circles;
mod deletions;
mod determinism;
mod drift;
mod durability;
mod frames;
mod house;
mod hysteresis;
mod pace;
mod ramps;
mod sessions;
mod several_patches;
mod silence;
mod silent_retare;
mod tare_under_load;
mod unseen_force;
mod validation;
mod zero;
mod zero_lost;
