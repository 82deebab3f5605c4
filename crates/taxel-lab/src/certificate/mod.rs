//! The calibration certificate of a model set: what a metrologist asks for, computed once from what was exported.
//!
//! [`Certificate::of`] takes the set, its session with the samples, the known loads and what people state, and gives
//! every number as JSON; the page shows the same numbers. No clock is read and nothing is measured here: the same input gives
//! the same bytes. How each number is defined is in `doc/certificate.md`; `tests/certificate/recompute.py` recomputes them from
//! the exported data.

mod budget;
mod command;
mod course;
mod evidence;
mod make;
mod page;
mod taxel;

pub use command::{CertificateArgs, certificate};
pub use evidence::{Evidence, Stated};
pub use make::Certificate;
