//! One fit for a whole skin: any recording of counts and pressures, of any kind of taxel, to calibrated curves.
//!
//! 1. Scans of equal pressure are groups (`course`): plateaus, typed pressures, or bins of each leg.
//! 2. Counts on pressure, monotone, with warp, order and dead zone chosen for the skin by leaving groups out (`form`).
//!    Counts carry the noise, so they are what is fitted; a curve of pressure on counts scatters ten times as much at
//!    light loads.
//! 3. Read backwards (`curve`): by the inverse, or by the mean of all pressures that explain a count, whichever errs less
//!    on what was left out. What falling groups leave is hysteresis (`lag`).
//! 4. The uncertainty by reading is that of single scans of groups that were left out (`sigma`).
//!
//! A taxel is excluded for what it is: without a swing, or with errors far beyond those of the others.

mod course;
mod curve;
mod fit;
mod fitted;
mod form;
mod lag;
mod least_squares;
mod sigma;

pub use course::{Leg, legs};
pub use fit::{Gathered, SWING_MIN, SkinError, fit};
pub use fitted::SkinFit;
pub use form::{Form, Warp};
pub use lag::SCANS as PLAY_SCANS;
