//! Known loads: what the skin reads under them, and how far it is off.
//!
//! An operator lays a known mass on the skin and says so; the live force is read for a second, judged, and kept with
//! everything that it depends on. What loads say of the gain of the models is in [`crate::recalibration`].

pub mod load;
pub mod owner;
pub mod places;
pub mod watch;

pub use load::{JudgedLoad, KnownLoad, Load, LoadsPlan, Reading, STANDARD_GRAVITY_M_PER_S2, Validation, Weight, judge};
pub use owner::Loads;
