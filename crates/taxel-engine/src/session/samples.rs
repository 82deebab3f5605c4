//! The samples of a session.

use crate::record::Sample;
use crate::rest::TaxelBaseline;

/// The zero at which a ramp began.
#[derive(Clone, Debug, PartialEq)]
pub struct RampBaseline {
    /// Number of the ramp.
    pub ramp: u16,
    /// One per taxel.
    pub taxels: Vec<TaxelBaseline>,
}

/// Everything that a session gathered.
#[derive(Clone, Debug, Default)]
pub struct SessionSamples {
    /// One per ramp begun.
    pub ramps: Vec<RampBaseline>,
    /// In the order of time.
    pub samples: Vec<Sample>,
}
