//! The drift of a patch as readers see it.

use taxel_skin::Newton;

/// What is done about drift now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriftState {
    /// It is not asked for, or there is no zero.
    #[default]
    Off,
    /// No module follows the others: touched, a session is open, a gap, too few modules, or the zero is too young.
    Held,
    /// Some modules follow, the others are held.
    Following,
    /// It has come to its bound in some module: the zero must be taken again.
    Bounded,
}

/// The drift of a patch as readers see it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriftView {
    /// What is done about it.
    pub state: DriftState,
    /// Since when, nanoseconds since 1970.
    pub since_wall_ns: i64,
    /// Median over the modules of what was added to the zero, counts; falls with warmth where counts fall with load.
    pub median_counts: f64,
    /// That of the module that drifted furthest, counts.
    pub max_counts: f64,
    /// Standard uncertainty of the drift, counts.
    pub sigma_counts: f64,
    /// How much of a load that lies on the whole patch it may have taken for drift.
    pub absorbed: Newton,
    /// Modules that follow the others now, and all.
    pub following: (u32, u32),
}
