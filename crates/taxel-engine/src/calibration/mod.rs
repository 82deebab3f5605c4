//! From rising pressure to models: the session, its ramps, its fit, and the fit of whole recordings.

pub(crate) mod branch;
pub mod export;
pub mod fit;
mod gauge_zero;
pub(crate) mod job;
#[cfg(test)]
mod job_tests;
pub(crate) mod limits;
pub(crate) mod plateau;
mod ramp;
mod refit;
mod rise;
pub(crate) mod samples;
pub(crate) mod session;
pub(crate) mod transition;
pub(crate) mod view;

pub use branch::{Branch, Direction};
pub use job::{FitJob, FitOutcome};
pub use limits::SessionLimits;
pub use plateau::{PLATEAUS_MIN, PlateauView};
pub use refit::{Refit, TOGETHER_MAX};
pub use samples::{NotLoaded, RampBaseline, Sample, SessionSamples};
pub use view::{RefusalCounts, SampleRefusal, SessionState, SessionView};
