//! Error against run time, the stability table, and what a scene costs: `taxeld report`. [`paper`] draws the paper's
//! figures: `taxeld paper`.
//!
//! Each section is a module with a function that measures and returns a [`document::Section`]; `page` makes files of
//! them.

pub mod daemon;
pub mod document;
pub mod machine;
pub mod options;
pub mod page;
pub mod paper;

mod digits;
mod draw;
mod force;
mod held_out;
mod numbers;
mod numpy;
mod peers;
mod polynomial;
mod rig;
mod run;
mod stability;
mod work_precision;

pub use rig::fits::calibrate;
pub use run::{names, run};
