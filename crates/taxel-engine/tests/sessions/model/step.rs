//! What can happen, and the scene in which it does.

/// A pass of time takes so long.
pub const PASS_S: u32 = 4;
/// What the pressure rises by in a pass.
pub const RISE_KPA: u32 = 16;
/// Where a ramp ends by itself; in the midst of the third pass.
pub const TARGET_KPA: u32 = 40;
/// Highest pressure that is reached.
pub const TOP_KPA: u32 = 64;
/// The patience of a session.
pub const PATIENCE_S: f64 = 9.6;
/// A sample enters a second after its scan.
pub const PROBATION_S: f64 = 1.0;
/// A ramp cannot start above this.
pub const VENTED_KPA: u32 = 10;

/// How a pass of time goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passing {
    Rise,
    Hold,
    /// The bag is vented within a second.
    Vent,
    /// The pressure stands and nobody says where.
    GaugeSilent,
    /// The pressure stands, and the second module is not heard.
    ModuleSilent,
}

/// A model set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Set {
    /// That of a fit, by the number of fits before it.
    Fit(usize),
    /// One made elsewhere; it says that it came from a session of this number, or, of 0, from none.
    Foreign(u64),
}

/// Something that happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    StartSession,
    StartRamp(u64),
    FinishRamp(u64),
    Abort(u64),
    Discard(u64),
    Activate(Set),
    Import(Set),
    Tare {
        confirmed: bool,
    },
    BringUp,
    Pass(Passing),
    BusOff,
    /// A fit that was handed out comes back.
    FitEnds {
        fit: usize,
        well: bool,
    },
    /// From now on nothing reaches the disk until it is told to.
    DiskSlow,
    /// All that waits is written, what follows from it waits again.
    DiskWrites,
    /// All that waits is written, and all to come at once.
    DiskFast,
    /// What waits is refused, and all to come.
    DiskFails,
    /// The daemon dies and starts again.
    Restart,
}

impl Step {
    pub fn is_command(self) -> bool {
        use Step::*;
        matches!(
            self,
            StartSession
                | StartRamp(_)
                | FinishRamp(_)
                | Abort(_)
                | Discard(_)
                | Activate(_)
                | Import(_)
                | Tare { .. }
                | BringUp
        )
    }
}

/// What the answer to the step is, if it was a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    Done,
    Refused,
    Later,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disk {
    Fast,
    Slow,
    Failed,
}
