//! Error against run time, the stability table, and what a scene costs: `taxeld report`. [`paper`] draws the paper's
//! figures: `taxeld paper`.
//!
//! Each section is a module with a function that measures and returns a [`document::Section`]; `page` makes files of
//! them.

pub mod daemon;
pub mod digits;
pub mod document;
pub mod held_out;
pub mod live;
pub mod machine;
pub mod options;
pub mod page;
pub mod paper;
pub mod peers;
pub mod plot;
pub mod reference;
pub mod stability;
pub mod work_precision;

mod markup;
mod numpy;
mod run;

pub use run::{names, run};
