//! The calibration session: taring, ramping, fitting, review, then active or discarded.

mod fit;
mod ramp;
mod run;
mod samples;
mod view;

pub use fit::{FitJob, FitOutcome, method};
pub use ramp::Direction;
pub use run::{Pending, Progress, SessionRun};
pub use samples::{RampBaseline, SessionSamples};
pub use view::{RefusalCounts, SampleRefusal, SessionState, SessionView};
