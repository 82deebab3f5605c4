//! The laboratory of taxeld: what is done at a desk with recordings, exported sessions and a daemon that runs elsewhere.
//!
//! Each command is a module with its arguments and a function that runs it.

#[macro_use]
extern crate taxel_files;

pub mod apply;
pub mod certificate;
pub mod compare;
mod daemon;
mod document;
pub mod fit;
mod forearm;
mod numbers;
mod page;
pub mod paper;
pub mod recording;
pub mod report;
mod session;
mod soundness;
mod svg;
