//! The samples of a session.

use taxel_skin::{Patch, Time};

use crate::baseline::TaxelBaseline;
use crate::counts::SharedCounts;
use crate::request::{ErrorReason, Rejection};

/// The zero at which a ramp began, of the taxels and of the gauge.
#[derive(Clone, Debug, PartialEq)]
pub struct RampBaseline {
    /// Number of the ramp.
    pub ramp: u16,
    /// One per taxel.
    pub taxels: Vec<TaxelBaseline>,
    /// What the gauge read while the skin rested, kPa: its own zero. `None` where that is not known.
    pub gauge_kpa: Option<f64>,
}

/// Everything that a session gathered.
#[derive(Clone, Debug, Default)]
pub struct SessionSamples {
    /// One per ramp begun.
    pub ramps: Vec<RampBaseline>,
    /// In the order of time.
    pub samples: Vec<Sample>,
}

impl SessionSamples {
    /// The zero of the last ramp, to which its models refer: the curves are fitted to the last rise, and a skin that was never
    /// pressed before does not return to its first zero.
    #[must_use]
    pub fn rest(&self) -> Option<&[TaxelBaseline]> {
        self.ramps.last().map(|ramp| ramp.taxels.as_slice())
    }

    /// Whether all are of a patch as it is now.
    pub(crate) fn is_of(&self, patch: &Patch) -> bool {
        let mut counts = self.samples.iter().map(|sample| sample.counts.counts());
        counts.all(|counts| counts.len() == patch.taxels().len() && counts.range() == patch.counts())
    }
}

/// Why the samples of a session cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NotLoaded {
    /// What is on disk is not what was written; what of it.
    Damaged(String),
    /// The store cannot read now; why.
    Unavailable(String),
}

impl NotLoaded {
    /// What is refused because of it; `damaged` says what is on disk, and what to do.
    pub(crate) fn refusal(self, damaged: impl FnOnce(String) -> String) -> Rejection {
        match self {
            Self::Damaged(what) => ErrorReason::DataDamaged.because(damaged(what)),
            Self::Unavailable(why) => Rejection::Unavailable(ErrorReason::StoreUnavailable, why),
        }
    }
}

/// One scan that entered a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Number of the ramp.
    pub ramp: u16,
    /// Time of the scan on the run's clock in nanoseconds.
    pub time_ns: i64,
    /// What the gauge read, interpolated at that time, kPa.
    pub pressure_kpa: f64,
    /// One raw count per taxel.
    pub counts: SharedCounts,
}

/// A scan on its way into the session.
#[derive(Clone, Debug)]
pub struct Pending {
    /// Mean time of its modules.
    pub time: Time,
    /// One raw count per taxel.
    pub counts: SharedCounts,
}
