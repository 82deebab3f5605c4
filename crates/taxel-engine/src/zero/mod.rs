//! What is zero, and does it hold: watched at rest, proven, followed with the temperature, and lost.

pub mod bag;
pub mod count_sums;
pub mod drift;
pub mod events;
pub mod evidence;
mod following;
mod ground;
pub mod holder;
pub mod kept;
mod losing;
mod module_offset;
pub mod offset;
mod over_restarts;
pub mod plan;
mod proven;
mod residue;
pub mod rest;
#[cfg(test)]
mod tests;
pub mod unloading;
pub mod view;
pub mod watch;
mod watching;

pub use events::ZeroEvent;
pub use holder::Zero;
pub use plan::{TarePlan, ZeroPlan};
pub use view::TareView;
pub use watch::Purpose;
