//! What is known of the vacuum bag when a scan comes.

/// What the bag does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bag {
    /// A session holds the patch: it is in the bag. Whether 70 kPa on all sides move thermal pads was not measured.
    pub session_open: bool,
    /// The gauge reads a pressure: what presses is the bag, and its going is seen.
    pub presses: bool,
    /// A ramp is under way and the bag does not let go, so that no load can vanish by itself.
    pub holds: bool,
}
