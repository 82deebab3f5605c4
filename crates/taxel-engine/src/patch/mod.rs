//! One patch: the organs, and the match over what they return.

mod ask;
mod bring_up;
#[cfg(test)]
pub(crate) mod edge_tests;
mod events;
pub(crate) mod owner;
mod publish;
