//! What is zero, and does it hold: watched at rest, proven, followed with the temperature, and lost.

pub(crate) mod bag;
pub(crate) mod events;
pub(crate) mod evidence;
mod ground;
pub(crate) mod holder;
pub(crate) mod kept;
mod losing;
mod module_offset;
mod offset;
pub(crate) mod rest;
#[cfg(test)]
mod tests;
pub(crate) mod view;
pub(crate) mod watch;
mod watching;
