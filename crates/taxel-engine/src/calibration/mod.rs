//! From rising pressure to models: the session, its ramps, its fit, and the fit of whole recordings.

pub mod branch;
pub mod calibrate;
#[cfg(test)]
mod calibrate_tests;
pub mod calibration_plan;
pub mod export;
pub mod fit;
mod gauge_zero;
pub mod job;
#[cfg(test)]
mod job_tests;
pub mod limits;
pub mod plateau;
pub mod ramp;
pub mod refit;
pub mod rise;
pub mod samples;
pub mod session;
#[cfg(test)]
mod session_tests;
pub mod transition;
pub mod view;

pub use branch::{Branch, Direction, PlaysChoice};
pub use calibrate::{Calibration, CalibrationEvent};
pub use calibration_plan::CalibrationPlan;
pub use job::{FitJob, FitOutcome};
pub use limits::SessionLimits;
pub use plateau::{PLATEAUS_MIN, PlateauView};
pub use refit::{Refit, StoredSession, TOGETHER_MAX};
pub use samples::{NotLoaded, RampBaseline, Sample, SessionSamples};
pub use view::{RefusalCounts, SampleRefusal, SessionState, SessionView};
