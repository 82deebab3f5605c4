//! The one owner of live state: frames and commands go in, snapshots, records and frames to send come out.
//!
//! Principles:
//! 1. No I/O, no clock, no runtime: [`Now`] is part of every call, so that the live bus, a log replay and the simulator
//!    run the very same engine, and a replay gives bit-identical results every time.
//! 2. A fact has one owner with private fields, which takes values and returns values. A folder that owns one kind of fact is
//!    an *organ*; none knows another.
//! 3. Only `patch` knows all organs of a patch, and only [`engine`] all patches.
//! 4. A force goes out as a good one only while its zero is proven.
//! 5. What an operator asks for takes effect when it is on disk: see `engine/pending.rs`.
//! 6. Within the crate a file imports from the file that defines an item; no files import each other in a circle.
//!
//! | folder | what it owns |
//! |---|---|
//! | `intake` | frames to scans: assembler, faults, boards, bring-up, gauge |
//! | `zero` | what is zero, and does it hold |
//! | [`force`] | models at the present zero, selection, sum, uncertainty |
//! | [`calibration`] | sessions and fits |
//! | [`loads`] | known loads and how far they are read off |
//! | [`recalibration`] | what known loads correct of a model set |
//! | [`boundary`] | inputs, outputs, commands, records, snapshots: all that the world sees |
//! | [`engine`] | `step`, commands, routes |
//!
//! Order of calls: [`Engine::new`], then [`Engine::step`] with each input in the order of time, and with [`Input::Tick`]
//! at the latest at [`Engine::next_deadline`]. Everything in [`Output`] is done in order.
//!
//! Words: *rest*: nothing touches the skin. *Baseline*: the counts at rest. *Zero*: the baseline that live force refers
//! to, and whether it holds. *Tare*: to take a zero. *Offset*: what is added to a value, such as the hysteresis offset.

pub mod baseline;
mod board_settings;
pub mod boundary;
pub mod calibration;
pub mod comparison;
pub mod conflict;
pub mod counts;
pub mod engine;
pub mod force;
mod intake;
pub mod known_set;
pub mod loads;
pub mod model_set;
mod names;
mod now;
mod patch;
pub mod plan;
pub mod recalibration;
mod regions;
mod request;
mod scan;
#[cfg(feature = "stability")]
pub mod stability;
pub mod statistics;
#[cfg(test)]
mod tests;
pub mod verdict;
mod zero;

pub use boundary::catalogue::Restored;
pub use boundary::input::Input;
pub use boundary::output::Output;
pub use boundary::pushed::PushedScan;
pub use boundary::{audit, catalogue, command, events, record, snapshot};
pub use engine::Engine;
pub use intake::health::BusNotice;
pub use now::Now;
pub use regions::Regions;
pub use request::{ErrorReason, Rejection, RequestId};
pub use scan::Scan;
pub use zero::rest::RestStatistics;
pub use zero::rest::limits::SCANS_MIN;
