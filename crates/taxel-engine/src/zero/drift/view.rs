//! The drift of a patch as readers see it.

use taxel_skin::Newton;

/// What is done about drift now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriftState {
    /// It is not asked for, or there is no zero.
    #[default]
    Off,
    /// No module is read: all are touched or were a moment ago, or a session is open.
    Held,
    /// Some modules are read, and their zero follows.
    Following,
    /// It has come to its bound in some module: the zero must be taken again.
    Bounded,
}

/// The drift of a patch as readers see it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftView {
    /// What is done about it.
    pub state: DriftState,
    /// Median over the modules of how far the zero has followed, counts towards load.
    pub median_counts: f64,
    /// That of the module that drifted furthest, counts.
    pub max_counts: f64,
    /// Standard uncertainty of the drift, counts.
    pub sigma_counts: f64,
    /// How much of a load that lies on the whole patch it may have taken for drift.
    pub absorbed: Newton,
}
