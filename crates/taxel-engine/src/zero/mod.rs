//! What is zero, and does it hold: watched at rest, proven, followed with the temperature, and lost.

pub mod bag;
pub mod continuity;
pub mod count_sums;
pub mod drift;
pub mod events;
mod following;
mod ground;
pub mod holder;
pub mod inputs;
pub mod kept;
pub mod lanes;
pub mod lookback;
mod losing;
mod over_restarts;
pub mod plan;
mod proven;
mod residue;
pub mod rest;
mod sudden;
#[cfg(test)]
mod tests;
pub mod unloading;
pub mod view;
mod warmth;
pub mod watch;
mod watching;

pub use events::ZeroEvent;
pub use holder::Zero;
pub use plan::{TarePlan, ZeroPlan};
pub use view::TareView;
pub use watch::Purpose;
