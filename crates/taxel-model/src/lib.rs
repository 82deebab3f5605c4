//! The mathematics of one taxel: from samples of (count, pressure) to a curve that turns counts into pressure.
//!
//! ```
//! use taxel_model::{FitOptions, Samples, fit};
//! let kpa: Vec<f64> = (0..700).map(|k| f64::from(k) / 10.0).collect();
//! let counts: Vec<f64> = kpa.iter().map(|kpa| (240.0 - 80.0 * kpa / (kpa + 40.0)).round()).collect();
//! let model = fit(&Samples::new(&counts, &kpa), &FitOptions::default());
//! assert!(model.is_usable());
//! let reading = model.evaluate(200.0).unwrap();
//! assert!((reading.kpa - 40.0).abs() < 1.0);
//! ```
//!
//! Counts are read by the fit of their skin ([`skin`]). Beside it stands the paper's polynomial ([`fit()`]):
//!
//! 1. Reduce: the mean of each count stands for all of its samples (`samples`).
//! 2. Solve on polynomials orthonormal over the reduced rows, refined in double-double (`orthogonal`, `refine`).
//! 3. Tell whether it is monotone (`curve`), and its error (`fit`).
//!
//! Beyond its range a curve goes on as the skin's curves do ([`SkinSlope`]). [`Status`] says whether a curve may be used,
//! [`Flag`]s what else there is to know.
//!
//! With the feature `stability` there are also the hard cases that every fit must come through (`stability`), and
//! exact least squares to judge by: for the tests and the report.
//!
//! Nothing here does I/O, and nothing panics on data: what has no curve says why. Equal samples give bit-identical
//! models in whatever order they come.

mod check;
mod curve;
mod dd;
mod extension;
mod figure;
mod fit;
mod model;
mod numbers;
mod options;
mod orthogonal;
mod plays;
mod points;
mod refine;
mod samples;
mod scale;
mod series;
pub mod skin;
#[cfg(feature = "stability")]
pub mod stability;
mod status;
mod uncertainty;
mod workers;

pub use curve::Curve;
pub use extension::{Beyond, End, Extension, SkinSlope};
pub use figure::figure;
pub use fit::fit;
pub use model::{Quality, RangeState, Reading, Sign, TaxelModel};
pub use options::{FitOptions, GaugeUncertainty, MAX_ORDER, TERMS_MAX};
pub use plays::{PLAYS, PlayState, Plays};
pub use points::{Points, Served};
pub use samples::Samples;
pub use status::{Flag, Status};
pub use uncertainty::{SigmaProfile, student_975};
pub use workers::{OneByOne, Workers, map};
