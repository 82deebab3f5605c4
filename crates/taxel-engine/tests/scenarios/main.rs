//! Whole scenes in virtual time: the simulated skin on one side, the engine on the other, nothing between.
//!
//! Every invariant of the house is held by a test that names it. Whatever a test is about, [`host::Host`] looks at
//! everything that the engine puts out: numbers are finite, a stale taxel has no reading, a force has its state.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod array;
mod bench;
#[path = "../common/disk.rs"]
#[allow(dead_code)]
mod disk;
mod host;
#[path = "../common/judge.rs"]
#[allow(dead_code)]
mod judge;
mod prelude;
#[path = "../common/rig.rs"]
mod rig;
mod say;
mod shared;
mod truth;
mod watch;

mod alarms;
mod board_settings;
mod branches;
mod bring_up;
mod bus_errors;
mod calibrate;
mod circles;
mod deletions;
mod described;
mod described_settings;
mod determinism;
mod drift;
mod durability;
mod events;
mod frames;
mod gauge_faults;
mod house;
mod hysteresis;
mod imports;
mod pace;
mod pushed;
mod ramps;
mod recalibrations;
mod refits;
mod session_settings;
mod sessions;
mod several_patches;
mod shared_boards;
mod silence;
mod silent_retare;
mod stored_sets;
mod tare_under_load;
mod typed;
mod unseen_force;
mod validation;
mod whole_robot;
mod zero;
mod zero_lost;
mod zero_under_load;
