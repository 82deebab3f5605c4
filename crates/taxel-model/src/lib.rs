//! The mathematics of one taxel: from samples of (count, pressure) to a curve that turns counts into pressure.
//!
//! ```
//! use taxel_model::{Accumulator, FitOptions, FixedPressure};
//! let mut sums = Accumulator::new(); // or `fit` on slices: any real abscissa, any number of samples
//! for k in 0..700_u32 {
//!     let kpa = f64::from(k) / 10.0;
//!     let count = 240.0 - 80.0 * kpa / (kpa + 40.0);
//!     sums.add(count.round() as u8, FixedPressure::from_kpa(kpa), 0);
//! }
//! let model = sums.fit(&FitOptions::default());
//! assert!(model.is_usable());
//! let reading = model.evaluate(200.0).unwrap();
//! assert!((reading.kpa - 40.0).abs() < 1.0);
//! let table = model.tabulate(0.0); // 256 pressures and deviations for the live path
//! assert_eq!(table.pressure_kpa[200], reading.kpa as f32);
//! ```
//!
//! 1. Reduce: exact sums per count or per bin of pressure stand for all samples ([`Accumulator`], `reduce`).
//! 2. Solve on polynomials orthonormal over the reduced rows, refined in double-double (`orthogonal`, `refine`).
//! 3. Choose the order (`order`), prove the shape or repair it (`shape`), tell the error (`uncertainty`).
//! 4. Beyond its range a curve goes on as the skin's curves do ([`SkinSlope`]).
//! 5. Judge: [`Status`] says whether the curve may be used, [`Flag`]s what else there is to know.
//!
//! With the feature `stability` there are also exact least squares in integers (`reference`) and the hard cases that every
//! fit must come through (`stability`): for the tests and the report.
//!
//! Nothing here does I/O, and nothing panics on data: what has no curve says why. Equal samples give bit-identical
//! models in whatever order they come.

mod accumulate;
mod bins;
pub mod bounded;
mod check;
mod clock;
mod curve;
mod dd;
mod decimal;
mod extension;
mod figure;
mod fit;
mod model;
mod nnls;
mod options;
mod order;
mod orthogonal;
mod plays;
mod points;
mod pressure;
mod reduce;
#[cfg(feature = "stability")]
pub mod reference;
mod refine;
mod samples;
mod scale;
mod series;
mod shape;
pub mod skin;
#[cfg(feature = "stability")]
pub mod stability;
mod status;
mod table;
mod uncertainty;
mod workers;

pub use accumulate::Accumulator;
pub use check::ModelError;
pub use clock::{ClockProblem, FoundClock};
pub use curve::Curve;
pub use dd::Dd;
pub use decimal::parse_decimal;
pub use extension::{Beyond, End, Extension, SkinSlope};
pub use figure::figure;
pub use model::{Quality, RangeState, Reading, Sign, TaxelModel};
pub use options::{
    Estimator, Exclusion, FitOptions, GaugeUncertainty, MAX_ORDER, MIN_BINNED_SAMPLES, Order, Rails, Shape, TERMS_MAX,
};
pub use order::OrderScore;
pub use plays::{PLAYS, PlayState, Plays};
pub use points::{Points, Served};
pub use pressure::FixedPressure;
pub use samples::{MAX_MAGNITUDE, Samples, fit};
pub use status::{Flag, Status};
pub use table::Table;
pub use uncertainty::{KNOTS_MAX, SigmaProfile, student_975};
pub use workers::{OneByOne, Workers, map};
