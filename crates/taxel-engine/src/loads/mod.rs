//! Known loads: what the skin reads under them, how far it is off, and the effective-area factor they give.
//!
//! An operator lays a known mass on the skin and says so; the live force is read for a second, judged, and kept with
//! everything that it depends on. Three loads or more with the active model set, at three places or more, give the factor
//! by which the areas are off in effect: gaps between taxels and what excluded ones leave uncounted are in it. It is
//! applied to the live force only where the plan asks for it.

pub mod factor;
pub mod load;
pub mod owner;
pub mod places;
pub mod validation;
pub mod watch;

pub use factor::{AreaFactor, LOADS_MIN};
pub use load::{KnownLoad, Load, Reading, STANDARD_GRAVITY_M_PER_S2, Weight};
pub use owner::{LOADS_MAX, Loads};
pub use validation::{JudgedLoad, Patch, Validation, judge};
