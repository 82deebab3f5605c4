//! What the engine wants on disk, in the order it happened.

use std::sync::Arc;

use crate::boundary::audit::{Answered, Asked};
pub use crate::calibration::samples::{RampBaseline, Sample};
use crate::calibration::view::SessionView;
use crate::loads::load::Load;
use crate::model_set::ModelSet;
pub use crate::zero::kept::{KeptZero, TakenZero};

/// One durable fact. The store appends them; none is ever changed, and what is deleted leaves a row that says so.
#[derive(Clone, Debug)]
pub enum Record {
    /// A session began or changed its state; the newest view of a session counts.
    Session(Arc<SessionView>),
    /// A ramp began.
    Ramp {
        /// Number of the session.
        session: u64,
        /// The zero at which it began.
        ramp: RampBaseline,
    },
    /// A scan entered the session.
    Sample {
        /// Number of the session.
        session: u64,
        /// Position of the sample in it, from 0.
        index: u64,
        /// The sample.
        sample: Sample,
    },
    /// A model set was made or imported.
    ModelSet(Arc<ModelSet>),
    /// A model set became the active one of its patch.
    Activated {
        /// The patch.
        patch: String,
        /// The set.
        model_set: String,
        /// When, nanoseconds since 1970.
        wall_ns: i64,
    },
    /// A model set was deleted.
    ModelSetDeleted {
        /// Its id.
        model_set: String,
    },
    /// A session was deleted, with its ramps and samples. Its number is never used again.
    SessionDeleted {
        /// Its number.
        session: u64,
    },
    /// A known load was read.
    Load(Arc<Load>),
    /// Somebody asked for something; the engine itself never records this.
    Asked(Box<Asked>),
    /// What came of it; the engine itself never records this.
    Answered(Box<Answered>),
    /// What is known of the zero of a patch and of those of its boards; the newest of a patch counts.
    Zero {
        /// The patch.
        patch: String,
        /// What.
        zero: KeptZero,
    },
}
