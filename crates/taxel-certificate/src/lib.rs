//! The calibration certificate of a model set: what a metrologist asks for, computed once from what is stored.
//!
//! [`Certificate::of`] takes the set, its session with the samples, the known loads and what people entered, and gives
//! every number as values; [`Certificate::to_json`] and [`Certificate::to_html`] write the same numbers. No clock is read
//! and nothing is measured here: the same input gives the same bytes. How each number is defined is in
//! `crates/taxeld/doc/certificate.md`; `deploy/certificate.py` recomputes them from the exported data.

mod budget;
mod course;
mod document;
mod entered;
mod evidence;
mod figures;
mod html;
mod levels;
mod limits;
mod loads;
mod make;
mod moment;
mod raw;
mod taxel;
mod words;

pub use document::Certificate;
pub use entered::Entered;
pub use evidence::Evidence;
