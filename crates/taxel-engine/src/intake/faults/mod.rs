//! Faults of taxels and modules, found from their own counts and status words.

pub(crate) mod detector;
#[cfg(test)]
mod edge_tests;
pub(crate) mod fault;
mod jumps;
pub(crate) mod limits;
mod taxel;
