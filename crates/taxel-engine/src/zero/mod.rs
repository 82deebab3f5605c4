//! What is zero, and does it hold: watched at rest, proven, followed with the temperature, and lost.

pub mod bag;
mod count_sums;
pub mod events;
pub mod evidence;
mod ground;
pub mod holder;
pub mod kept;
mod losing;
mod module_offset;
mod offset;
pub mod plan;
pub mod rest;
#[cfg(test)]
mod tests;
pub mod view;
pub mod watch;
mod watching;
